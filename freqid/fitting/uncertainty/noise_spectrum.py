"""The noise that a fit leaves: its spectrum, weights from it, and the covariance that it makes."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.cost.experiments import Evaluation, SpectralExperiment
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.stamped_experiments import StampedExperiment
from freqid.fitting.cost.time_experiments import TimeExperiment
from freqid.fitting.uncertainty.evenness import evenly_spread
from freqid.lti import Realisation, eliminate, in_one_blas_thread

# lines of an experiment that are enough for a covariance
_LINES = 4000
# autoregressions of at most this order, and lines that each order needs
_ORDERS, _ORDER_LINES = 8, 15
# leverage that is believed at the most
_MOST = 0.9


def smoothed_power(error: ComplexArray) -> FloatArray:
    """Local mean of |error|² over neighbouring lines, (…, K), for errors (…, K).

    A steep spectrum is made flat by an autoregression first and given its shape back after, which
    keeps the mean over neighbours from filling its valleys and cutting its peaks (prewhitening:
    Blackman and Tukey, The Measurement of Power Spectra, 1958).
    """
    power = np.abs(error) ** 2
    K = power.shape[-1]
    shape = _autoregressive(power.reshape(-1, K)).reshape(power.shape)
    return shape * _local_mean(power / shape)


def _spectrum(error: ComplexArray) -> FloatArray:
    """The noise's power for errors (channels, K): an autoregression, where that makes it even.

    Local means beside it would follow the very lines that they are to weigh, of which a parameter
    may have few.
    """
    power = np.abs(error) ** 2
    shape = _autoregressive(power)
    whitened = power / shape
    local = _local_mean(whitened)
    for row, each in enumerate(whitened):
        if evenly_spread(np.sqrt(each)[None]):
            local[row] = each.mean()
    return shape * local


def _local_mean(power: FloatArray) -> FloatArray:
    K = power.shape[-1]
    width = min(2 * int(np.sqrt(K)) + 1, K)
    smooth: FloatArray = scipy.ndimage.uniform_filter1d(power, width, axis=-1, mode="reflect")
    return smooth


def _autoregressive(power: FloatArray) -> FloatArray:
    """Spectra of autoregressions for periodograms (channels, K), ones where none is needed.

    Levinson's recursion, the order by Bayes' criterion (Stoica and Moses, Spectral Analysis of
    Signals, 2005, sections 3.5.1 and C.8).
    """
    K = power.shape[1]
    shape = np.ones(power.shape)
    most = min(_ORDERS, K // _ORDER_LINES)
    if most < 1:
        return shape
    for row, one in enumerate(power):
        r = scipy.fft.irfft(one)[: most + 1]
        if not r[0] > 0:
            continue
        a, left = np.ones(1), float(r[0])
        best, chosen = 2 * K * np.log(left), a
        for order in range(1, most + 1):
            k = -float(a @ r[order:0:-1]) / left
            a = np.append(a, 0.0) + k * np.append(0.0, a[::-1])
            left *= 1 - k**2
            if not left > 1e-12 * r[0]:
                break
            criterion = 2 * K * np.log(left) + order * np.log(2 * K)
            if criterion < best:
                best, chosen = criterion, a
        if len(chosen) > 1:
            angle = np.pi * np.arange(K) / max(K - 1, 1)
            gain = np.abs(np.polyval(chosen[::-1], np.exp(-1j * angle))) ** 2
            shape[row] = 1 / np.maximum(gain, 1e-300)
    return shape


def noise_weights(error: ComplexArray, n_samples: int) -> FloatArray:
    """1/variance at each line from the errors (outputs, K) that a fit left there.

    In a record's cost, Σ 2|E|²/N, every real value then adds a half, as it does to a response's
    under weights of 1/variance.
    """
    variance = _spectrum(error)
    floor = 1e-12 * variance.max(initial=0)
    return n_samples / 2 / np.maximum(variance, max(float(floor), 1e-300))


@in_one_blas_thread
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
    stamped = [e for e in objective.experiments if isinstance(e, StampedExperiment)]
    if all(isinstance(e, TimeExperiment) for e in objective.experiments):
        return _of_samples(objective, x, alone)
    if len(lines) + len(stamped) < len(objective.experiments):
        return None
    try:
        realisation = objective.structure.realise(x)
        noise_at = realisation if alone is None else objective.structure.realise(alone)
    except Exception:  # the user's function may raise anything
        return None
    total, rows, unknown = np.zeros((len(x), len(x))), 0, 0
    with np.errstate(all="ignore"):
        for e in lines:
            step = 1 if e.reach else max(e.n_lines // _LINES, 1)
            few = e.thinned(1 / step, evenly=True) if step > 1 else e
            evaluation = few.at(realisation)
            r, Q, delta = projected(evaluation)
            J = evaluation.jacobian(delta)
            J = J - (J @ Q.T) @ Q
            left = r if noise_at is realisation else projected(few.at(noise_at))[0]
            if e.response:
                total += _of_response(J, left, few) / step
            else:
                left = left / np.sqrt(1 - leverage(J, Q))
                total += (J * local_power(left, few)) @ J.T / step
            rows += e.n_rows
            unknown += 0 if delta is None else len(delta)
        for log in stamped:
            part, n_free = _of_stamps(log, realisation, noise_at)
            total += part
            rows += log.n_rows
            unknown += n_free
    if not np.isfinite(total).all():
        return None
    # lines of a response have had their share of the freedom taken off one by one
    if lines and not stamped and all(e.response for e in lines):
        return total
    return total * rows / max(rows - unknown - len(x), 1)


def _of_samples(objective: Objective, x: FloatArray, alone: FloatArray | None) -> FloatArray | None:
    """The same of experiments in time, whose lines are those of the samples' own DFT."""
    try:
        realisation = objective.structure.realise(x)
        noise_at = realisation if alone is None else objective.structure.realise(alone)
    except Exception:  # the user's function may raise anything
        return None
    total, rows, unknown = np.zeros((len(x), len(x))), 0, 0
    for e in objective.experiments:
        assert isinstance(e, TimeExperiment)
        if e.lines is not None:
            return None
        evaluation = e.at(realisation)
        left, Q, delta = projected(evaluation)
        J = evaluation.jacobian(delta)
        J = J - (J @ Q.T) @ Q
        if noise_at is not realisation:
            left = projected(e.at(noise_at))[0]
        p = len(e.y)
        R, JF = (scipy.fft.rfft(a.reshape(*a.shape[:-1], p, -1), norm="ortho") for a in (left, J))
        N = e.y.shape[1]
        twice = np.full(R.shape[-1], 2.0)
        twice[0] = 1.0
        if N % 2 == 0:
            twice[-1] = 1.0
        # J'Σ J over all samples is that over the lines, each but the ends standing for two
        seen = (JF * (smoothed_power(R) * twice)).reshape(len(x), -1)
        total += (seen @ JF.reshape(len(x), -1).conj().T).real
        rows += e.n_rows
        unknown += 0 if delta is None else len(delta)
    if not np.isfinite(total).all():
        return None
    return total * rows / max(rows - unknown - len(x), 1)


def leverage(J: FloatArray, Q: FloatArray) -> FloatArray:
    """Part of each complex error that parameters and initial state take on themselves, twice each,
    (rows,): the few lines that tell a parameter leave less than their noise (MacKinnon and White,
    J. Econometrics 29, 1985).
    """
    gram = J @ J.T
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    half = np.linalg.pinv(gram / np.outer(size, size), hermitian=True) / np.outer(size, size)
    own = np.einsum("ak,ab,bk->k", J, half, J) + np.sum(Q**2, axis=0)
    return np.repeat(np.minimum(own.reshape(-1, 2).mean(axis=1), _MOST), 2)


def _of_stamps(
    e: StampedExperiment, at: Realisation, noise_at: Realisation
) -> tuple[FloatArray, int]:
    """The same of samples at times of their own, each output's noise taken for white, and how many
    unknowns its initial state has.
    """
    evaluation = e.at(at)
    left, Q, delta = projected(evaluation)
    J = evaluation.jacobian(delta)
    J = J - (J @ Q.T) @ Q
    if noise_at is not at:
        left = projected(e.at(noise_at))[0]
    power = np.mean(left.reshape(e.y.shape) ** 2, axis=0)
    return (J * np.tile(power, len(e.y))) @ J.T, 0 if delta is None else len(delta)


def _of_response(J: FloatArray, residual: FloatArray, e: SpectralExperiment) -> FloatArray:
    """What the noise of a response makes of the gradient, (P, P).

    Its size is each line's own, divided by what the fit leaves of it (MacKinnon and White's HC3, J.
    Econometrics 29, 1985): a resonance that few lines tell has noise like none of its neighbours.
    Within the ``reach`` of a line noise goes together as it does on average.
    """
    error = residual.view(complex)
    at = J[:, ::2] + 1j * J[:, 1::2]
    gram = J @ J.T
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    half = np.linalg.pinv(gram / np.outer(size, size), hermitian=True) / np.outer(size, size)
    lever = np.einsum("ak,ab,bk->k", at.conj(), half, at).real / 2
    left = error / np.maximum(1 - lever, 0.1)
    total: FloatArray = (np.abs(left) ** 2 * at.conj() @ at.T).real / 2
    if not e.reach:
        return total
    each = left.reshape(-1, e.n_lines)
    local = np.sqrt(np.maximum(_local_mean(np.abs(each) ** 2), 1e-300))
    unit, here = each / local, at.reshape(len(at), *each.shape) * local
    total = (here.conj().reshape(len(at), -1) @ here.reshape(len(at), -1).T).real / 2
    for d in range(1, min(e.reach, e.n_lines - 1) + 1):
        # lines far apart in the window share little of it: Bartlett's taper
        share = np.mean(unit[:, :-d] * unit[:, d:].conj())
        pairs = (here[..., :-d].conj().reshape(len(at), -1) * share) @ here[..., d:].reshape(
            len(at), -1
        ).T
        total += (pairs + pairs.conj().T).real / 2
    return total


def projected(evaluation: Evaluation) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """The residual with the transient taken off, the rows that span that, and its unknowns."""
    r, T = evaluation.residual, evaluation.transient
    if T is None:
        return r, np.zeros((0, len(r))), None
    Q, delta = eliminate(T, r)
    return r - (Q @ r) @ Q, Q, delta


def local_power(residual: FloatArray, e: SpectralExperiment) -> FloatArray:
    """Local mean of the squared residual, for each of its real values."""
    each = residual.view(complex).reshape(-1, e.n_lines)
    counted = (e.lines.scale > 0).astype(float).reshape(each.shape)
    if counted.all():
        local = smoothed_power(each)
    else:
        local = _local_mean(np.abs(each) ** 2) / np.maximum(_local_mean(counted), 1e-9)
    # half of a complex error's power is in each of its parts
    power: FloatArray = np.repeat(local.ravel() / 2, 2)
    return power
