"""What the noise that a fit leaves makes of its gradient: the covariance of the estimate."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.data import ToldNoise
from freqid.fitting.cost.evaluation import projected
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.fitting.cost.log_responses import LogResponse
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.periodic_experiments import PeriodicExperiment
from freqid.fitting.cost.stamped_experiments import StampedExperiment
from freqid.fitting.cost.time_experiments import TimeExperiment
from freqid.fitting.uncertainty.leverage import leverage
from freqid.fitting.uncertainty.noise_of_series import of_series
from freqid.fitting.uncertainty.noise_spectrum import local_mean
from freqid.fitting.uncertainty.outputs_together import of_outputs
from freqid.lti import Realisation, tuned

# means for each unknown from which they tell their own noise
_MEANS = 5
# values that hardly tell a colour: their noise is no less than white
FEW = 100
# complex values of a line and its neighbours that tell by how much its noise is off
_VALUES = 10
# part of the largest direction of a Jacobian below which one is rounding
_TOLD = 1e-14
# standard errors by which variances are too large for certain
_CERTAIN = 4.0
# leverage from which a line may be all but a parameter's own
_ALONE = 0.5


@tuned
@np.errstate(all="ignore")
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
    if all(isinstance(e, PeriodicExperiment) for e in objective.experiments):
        return _of_periods(objective, x)
    if all(isinstance(e, TimeExperiment) for e in objective.experiments):
        return _of_samples(objective, x, alone)
    if all(isinstance(e, LogResponse) for e in objective.experiments):
        return _of_logarithms(objective, x, alone)
    if len(lines) + len(stamped) < len(objective.experiments):
        return None
    try:
        realisation = objective.structure.realise(x)
        noise_at = realisation if alone is None else objective.structure.realise(alone)
    except Exception:  # the user's function may raise anything
        return None
    total, rows, unknown = np.zeros((len(x), len(x))), 0, 0
    H, cost = np.zeros((len(x), len(x))), 0.0
    for e in lines:
        # all of its lines: those few that an input has, or that tell a parameter, are not to be
        # missed
        evaluation = e.at(realisation)
        r, Q, delta = projected(evaluation)
        J = evaluation.jacobian(delta)
        J = J - (J @ Q.T) @ Q
        left = r if noise_at is realisation else projected(e.at(noise_at))[0]
        if e.response:
            size = e.lines.scale.reshape(*e.n_channels, -1)
            total += _of_response(J, left, size, e.reach, e.line_noise)
        else:
            total += of_outputs(J, Q, left, e)
        rows += e.n_rows
        unknown += 0 if delta is None else len(delta)
        H, cost = H + J @ J.T, cost + float(r @ r)
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
    freedom = max(rows - unknown - len(x), 1)
    total = total * rows / freedom
    # those of a prior are no noise, and a response has noise of its own at each line
    bare = alone is None and not stamped and not any(e.response for e in lines)
    return larger(total, cost / freedom * H, H) if rows < FEW and bare else total


def _of_samples(objective: Objective, x: FloatArray, alone: FloatArray | None) -> FloatArray | None:
    """The same of experiments in time, whose lines are those of the samples' own DFT."""
    try:
        realisation = objective.structure.realise(x)
        noise_at = realisation if alone is None else objective.structure.realise(alone)
    except Exception:  # the user's function may raise anything
        return None
    total, rows, unknown = np.zeros((len(x), len(x))), 0, 0
    H, cost = np.zeros((len(x), len(x))), 0.0
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
        absorbed = Q.reshape(len(Q), *left.reshape(len(e.y), -1).shape)
        total += of_series(J.reshape(len(x), len(e.y), -1), left.reshape(len(e.y), -1), absorbed)
        rows += e.n_rows
        unknown += 0 if delta is None else len(delta)
        H, cost = H + J @ J.T, cost + float(left @ left)
    if not np.isfinite(total).all():
        return None
    freedom = max(rows - unknown - len(x), 1)
    total = total * rows / freedom
    return larger(total, cost / freedom * H, H) if rows < FEW else total


def _of_periods(objective: Objective, x: FloatArray) -> FloatArray | None:
    """The same of means over periods.

    Their covariances are estimates, and take in that of neighbours: what they leave of the errors
    says how far off they are. That of each line follows a peak of the noise, and scatters where few
    lines tell a parameter; that of some together does neither. What is larger counts, along each
    combination of parameters; of a line that a parameter has all but to itself some tell.
    """
    periodic = [e for e in objective.experiments if isinstance(e, PeriodicExperiment)]
    if sum(e.n_means for e in periodic) < _MEANS * len(x):
        return None
    try:
        realisation = objective.structure.realise(x)
    except Exception:  # the user's function may raise anything
        return None
    parts = [e.at(realisation) for e in periodic]
    J = np.concatenate([part.jacobian(None) for part in parts], axis=1)
    taken = leverage(J, np.zeros((0, J.shape[1])))[::2]
    one, some, at = np.zeros((len(x), len(x))), np.zeros((len(x), len(x))), 0
    for e, part in zip(periodic, parts, strict=True):
        p, n = len(e.data.response), part.residual.size // 2
        # how the errors of a line are turned into independent ones depends on the outputs' order
        rest = 1 - taken[at : at + n].reshape(-1, p).mean(axis=1)
        error = part.residual.view(complex).reshape(-1, p)
        seen = J[:, 2 * at : 2 * (at + n)].copy().view(complex).reshape(len(x), -1, p)
        left = (np.abs(error) ** 2).mean(axis=1)
        level = _around(left, e, p) / _around(rest, e, p)
        weighed = seen * level[:, None]
        alone = rest < 1 - _ALONE
        score = (seen.conj() * (error / rest[:, None])).sum(axis=-1)[:, ~alone]
        one += (score @ score.conj().T).real / 2
        one += np.einsum("ikp,jkp->ij", weighed[:, alone], seen[:, alone].conj()).real / 2
        some += e.inflation * np.einsum("ikp,jkp->ij", weighed, seen.conj()).real / 2
        at += n
    if not (np.isfinite(one).all() and np.isfinite(some).all()):
        return None
    return larger(one, some, J @ J.T)


def larger(one: FloatArray, other: FloatArray, H: FloatArray) -> FloatArray:
    """The least matrix that is no less than either of two (P, P), in coordinates where H is one."""
    unit = np.sqrt(np.maximum(np.diag(H), 1e-300))
    sizes, ways = np.linalg.eigh(H / unit / unit[:, None])
    kept = sizes > _TOLD * sizes.max()
    root, back = (ways[:, kept] * sizes[kept] ** s for s in (0.5, -0.5))
    more, apart = np.linalg.eigh(back.T @ ((one - other) / unit / unit[:, None]) @ back)
    turned = unit[:, None] * (root @ apart)
    return np.asarray(other + (turned * np.maximum(more, 0)) @ turned.T)


def _around(each: FloatArray, e: PeriodicExperiment, p: int) -> FloatArray:
    """Mean over the neighbours of each line and over experiments, of lines of ``p`` outputs."""
    count = e.data.outputs.shape[1]
    lines = each.reshape(count, -1).mean(axis=0)
    width = min(-(-_VALUES // (count * p)) | 1, len(lines))
    return np.tile(scipy.ndimage.uniform_filter1d(lines, width, mode="reflect"), count)


def _of_stamps(
    e: StampedExperiment, at: Realisation, noise_at: Realisation
) -> tuple[FloatArray, int]:
    """The same of samples at times of their own, whose noise has the colour that it has from one
    sample to the next, and how many unknowns their initial state has.
    """
    evaluation = e.at(at)
    left, Q, delta = projected(evaluation)
    J = evaluation.jacobian(delta)
    J = J - (J @ Q.T) @ Q
    if noise_at is not at:
        left = projected(e.at(noise_at))[0]
    J, Q = (np.moveaxis(M.reshape(len(M), *e.y.shape), 2, 1) for M in (J, Q))
    return of_series(J, left.reshape(e.y.shape).T, Q), 0 if delta is None else len(delta)


def _of_response(
    J: FloatArray,
    residual: FloatArray,
    scale: FloatArray,
    reach: int,
    noise: ToldNoise | None,
) -> FloatArray:
    """What the noise of a response makes of the gradient, (P, P); its errors (outputs, inputs, K)
    were multiplied by the ``scale``.

    Its size is each line's own, divided by what the fit leaves of it (MacKinnon and White's HC3, J.
    Econometrics 29, 1985): a resonance that few lines tell has noise like none of its neighbours.
    Within the ``reach`` of a line noise goes together as it does on average. A variance that is
    told counts, and in a response by local models as these take it from the outputs' lines.
    """
    error, lines = residual.view(complex), scale.shape[-1]
    at = J[:, ::2] + 1j * J[:, 1::2]
    if noise is not None:
        wider = _against_what_is_told(error, scale**2 * noise.variance, reach)
        return wider * noise.along(at.reshape(len(at), *scale.shape) * scale)
    lever = leverage(J, np.zeros((0, J.shape[1])))[::2]
    left = error / (1 - lever)
    # a line that a parameter has all but to itself leaves nothing that tells: no less than all do
    by_all = np.sqrt(np.mean(np.abs(error) ** 2) / (1 - np.mean(lever)))
    low = (lever > _ALONE) & (np.abs(left) < by_all)
    left[low] *= by_all / np.maximum(np.abs(left[low]), 1e-300)
    total: FloatArray = (np.abs(left) ** 2 * at.conj() @ at.T).real / 2
    if not reach:
        return total
    each = left.reshape(-1, lines)
    local = np.sqrt(np.maximum(local_mean(np.abs(each) ** 2), 1e-300))
    unit, here = each / local, at.reshape(len(at), *each.shape) * local
    total = (here.conj().reshape(len(at), -1) @ here.reshape(len(at), -1).T).real / 2
    for d in range(1, min(reach, lines - 1) + 1):
        # lines far apart in the window share little of it: Bartlett's taper
        share = np.mean(unit[:, :-d] * unit[:, d:].conj())
        pairs = (here[..., :-d].conj().reshape(len(at), -1) * share) @ here[..., d:].reshape(
            len(at), -1
        ).T
        total += (pairs + pairs.conj().T).real / 2
    return total


def _against_what_is_told(error: ComplexArray, told: FloatArray, reach: int) -> float:
    """By how much the variances of errors (rows,) are larger than those that are ``told``, or
    smaller at all lines alike; those within the ``reach`` of a line are no news.

    Noise moves denominators, and what is left is larger than its first order says.
    """
    power, told = np.abs(error) ** 2, told.ravel()
    counted = told > 0
    if not counted.any():
        return 1.0
    level = float(power[counted].sum() / told[counted].sum())
    if level >= 1:
        return level
    # few lines may make up the sum: only all of them together say that too much was told
    each = float(np.mean(power[counted] / told[counted]))
    certain = each < 1 - _CERTAIN * np.sqrt((2 * reach + 1) / counted.sum())
    return max(level, each) if certain else 1.0


def _of_logarithms(
    objective: Objective, x: FloatArray, alone: FloatArray | None
) -> FloatArray | None:
    """The same of logarithms of responses, whose errors are those of the responses, in their phase
    and as parts of them.
    """
    try:
        realisation = objective.structure.realise(x)
        noise_at = realisation if alone is None else objective.structure.realise(alone)
    except Exception:  # the user's function may raise anything
        return None
    total = np.zeros((len(x), len(x)))
    for e in objective.experiments:
        assert isinstance(e, LogResponse)
        rows = [e.at(noise_at).residual, *e.at(realisation).jacobian(None)]
        turned = (np.array(rows).view(complex) * e.turn.ravel()).view(float)
        scale = np.asarray(e.weight / np.abs(e.measured))
        total += _of_response(turned[1:], turned[0], scale, e.reach, e.line_noise)
    return total if np.isfinite(total).all() else None
