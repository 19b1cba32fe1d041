"""The multisine that determines a plant's parameters best together."""

from __future__ import annotations

import numpy as np

from freqid.checks import FloatArray, InputError, an, positive
from freqid.excitation import LineSpectrum, multisine_lines
from freqid.fitting import GreyStructure
from freqid.lti import Hold, PeriodicHold, ZeroOrderHold, known_hold, sampled_response
from freqid.models import GreyBox

# lines of a D-optimal design, and a share of the power below which one is left out
_GRID_LINES = 4000
_LEAST_SHARE = 1e-4


def d_optimal_spectrum(
    plant: GreyBox,
    band: tuple[float, float],
    period: float,
    dt: float,
    hold: Hold | None = None,
    *,
    power: float = 1.0,
) -> LineSpectrum:
    """The multisine of a given power that makes the information's determinant largest.

    Args: ``plant`` at its values; ``band`` in Hz, lines at multiples of 1/``period`` (s); ``dt`` of
    the record in s; ``hold`` of the input, a zero-order hold at ``dt`` where not given; ``power``
    in u².
    Multiplicative updates (Fedorov and Hackl, Model-Oriented Design of Experiments, 1997, section
    3.2) raise the determinant at each step. Returns a LineSpectrum of the few lines that carry
    power. Raises ValueError for a band without lines, or lines that do not determine the
    parameters.

    >>> import freqid as fq
    >>> best = d_optimal_spectrum(fq.first_order(), (1, 60), 1.0, 1e-3)
    >>> len(best.frequencies) <= 3
    True
    """
    an("plant", plant, GreyBox)
    k = multisine_lines(band, period)
    k = k[np.unique(np.linspace(0, len(k) - 1, _GRID_LINES).astype(int))]
    structure = GreyStructure(plant)
    between = ZeroOrderHold(dt) if hold is None else known_hold("hold", hold)
    omega = 2 * np.pi * k / period
    if isinstance(between, PeriodicHold) and omega[-1] * dt > np.pi * (1 + 1e-9):
        raise InputError(f"band={band} Hz reaches beyond {0.5 / dt:g} Hz, the Nyquist limit")
    _, dG = sampled_response(structure.realise(structure.start), omega, between)
    P = len(structure.names)
    rows = np.moveaxis(dG, -1, 0).reshape(len(k), P, -1)
    each = (rows @ rows.conj().swapaxes(-1, -2)).real
    share = np.full(len(k), 1 / len(k))
    for _ in range(3000):
        H = np.tensordot(share, each, 1)
        scale = np.sqrt(np.diag(H))
        try:
            inverse = np.linalg.inv(H / np.outer(scale, scale)) / np.outer(scale, scale)
        except np.linalg.LinAlgError:
            raise InputError(
                f"band={band} Hz with a period of {period:g} s does not determine the parameters"
            ) from None
        gain = np.einsum("kij,ji->k", each, inverse) / P
        if gain.max() < 1 + 1e-4:
            break
        share = share * gain
    keep = share > _LEAST_SHARE
    kept: FloatArray = share[keep] / share[keep].sum() * positive("power", power)
    return LineSpectrum((k[keep] / period).tolist(), kept.tolist())
