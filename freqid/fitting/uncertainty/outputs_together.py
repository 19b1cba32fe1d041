"""What the noise of a record's outputs makes of a gradient, where outputs share some of it.

Turbulence shakes all outputs of an aircraft, each by its own response: next to a mode they err as
one, with phases of their own, and above it each by its sensor alone. What they share is told line
by line, and a fit that follows it at few lines follows it in all outputs at once.
"""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.uncertainty.evenness import err_together
from freqid.fitting.uncertainty.leverage import before_the_fit, leverage
from freqid.fitting.uncertainty.noise_spectrum import autoregressive, local_power

# lines over which what outputs share is alike: a light mode has few
_NEAR = 7


def of_outputs(J: FloatArray, Q: FloatArray, left: FloatArray, e: SpectralExperiment) -> FloatArray:
    """J C Jᵀ (P, P), what noise makes of the gradient of rows J (P, rows) that leave these (rows,),
    beside the free motion's directions Q (q, rows): each output's own colour, and where they share
    noise what they share at each line.
    """
    if not err_together(left, e):
        power = local_power(left / np.sqrt(1 - leverage(J, Q)), e)
        return np.asarray((J * power) @ J.T)
    each = before_the_fit(J, Q, left, e.n_lines).view(complex).reshape(-1, e.n_lines)
    # made flat, so that means over lines do not cut its peaks
    counted = (e.lines.scale > 0).reshape(each.shape).astype(complex)
    whole = bool(counted.all())
    size = np.sqrt(autoregressive(np.abs(each) ** 2)) if whole else np.ones(each.shape)
    ways = J.view(complex).reshape(len(J), *each.shape) * size
    power = _smooth(each[:, None] * each[None].conj() / (size[:, None] * size[None]))
    if not whole:
        # lines that do not count leave nothing, which is no lack of noise
        power = power / np.maximum(_smooth(counted[:, None] * counted[None]).real, 1e-9)
    # a complex error has half of its power in each of its parts
    return np.einsum("aik,ijk,bjk->ab", ways.conj(), power, ways, optimize=True).real / 2


def _smooth(products: ComplexArray) -> ComplexArray:
    """Means over neighbouring lines, the last axis."""
    near = min(_NEAR, products.shape[-1])
    smooth: ComplexArray = scipy.ndimage.uniform_filter1d(
        products.real, near, axis=-1
    ) + 1j * scipy.ndimage.uniform_filter1d(products.imag, near, axis=-1)
    return smooth
