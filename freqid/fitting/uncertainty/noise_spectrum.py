"""The noise that a fit leaves: its spectrum, weights from it, and the covariance that it makes."""

from __future__ import annotations

import numpy as np
import scipy.ndimage

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.cost.experiments import Evaluation, SpectralExperiment
from freqid.fitting.cost.objective import Objective
from freqid.lti import eliminate

# lines of an experiment that are enough for a covariance
_LINES = 4000


def smoothed_power(error: ComplexArray) -> FloatArray:
    """Local mean of |error|² over neighbouring lines, (…, K), for errors (…, K)."""
    power = np.abs(error) ** 2
    K = power.shape[-1]
    width = min(2 * int(np.sqrt(K)) + 1, K)
    smooth: FloatArray = scipy.ndimage.uniform_filter1d(power, width, axis=-1, mode="reflect")
    return smooth


def noise_weights(error: ComplexArray, n_samples: int) -> FloatArray:
    """1/variance at each line from the errors (outputs, K) that a fit left there.

    In a record's cost, Σ 2|E|²/N, every real value then adds a half, as it does to a response's
    under weights of 1/variance.
    """
    variance = smoothed_power(error)
    floor = 1e-12 * variance.max(initial=0)
    return n_samples / 2 / np.maximum(variance, max(float(floor), 1e-300))


def score_covariance(
    objective: Objective, x: FloatArray, alone: FloatArray | None = None
) -> FloatArray | None:
    """Σ σ²(ω) JᵀJ over the lines (P, P): what coloured noise does to the gradient.

    With H = JᵀJ the covariance of the estimate is H⁻¹ M H⁻¹ whatever the noise's colour (Ljung,
    System Identification, 1999, section 9.4); σ² is the local mean of the squared residual. None
    where the experiments have no lines, or nothing but rounding is left. ``alone`` (P,) is where
    the data alone are least: what they leave there is noise, what a prior makes them leave is not.
    """
    lines = [e for e in objective.experiments if isinstance(e, SpectralExperiment)]
    if len(lines) < len(objective.experiments):
        return None
    try:
        realisation = objective.structure.realise(x)
        noise_at = realisation if alone is None else objective.structure.realise(alone)
    except Exception:  # the user's function may raise anything
        return None
    total, rows, unknown = np.zeros((len(x), len(x))), 0, 0
    with np.errstate(all="ignore"):
        for e in lines:
            step = max(e.n_lines // _LINES, 1)
            few = e.thinned(1 / step, evenly=True) if step > 1 else e
            evaluation = few.at(realisation)
            r, Q, delta = _projected(evaluation)
            J = evaluation.jacobian(delta)
            J = J - (J @ Q.T) @ Q
            left = r if noise_at is realisation else _projected(few.at(noise_at))[0]
            power = _local_power(left, few)
            total += (J * power) @ J.T / step
            rows += e.n_rows
            unknown += 0 if delta is None else len(delta)
    if not np.isfinite(total).all():
        return None
    return total * rows / max(rows - unknown - len(x), 1)


def _projected(evaluation: Evaluation) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """The residual with the transient taken off, the rows that span that, and its unknowns."""
    r, T = evaluation.residual, evaluation.transient
    if T is None:
        return r, np.zeros((0, len(r))), None
    Q, delta = eliminate(T, r)
    return r - (Q @ r) @ Q, Q, delta


def _local_power(residual: FloatArray, e: SpectralExperiment) -> FloatArray:
    """Local mean of the squared residual, for each of its real values."""
    each = residual.view(complex).reshape(-1, e.n_lines)
    counted = (e.lines.scale > 0).astype(float).reshape(each.shape)
    local = smoothed_power(each) / np.maximum(smoothed_power(counted), 1e-9)
    # half of a complex error's power is in each of its parts
    power: FloatArray = np.repeat(local.ravel() / 2, 2)
    return power
