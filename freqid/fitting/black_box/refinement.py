"""The start of a black box: subspace identification, and with one input and output far more.

A rational function on the lines is followed down to its minimum from several starts: from no poles
at all, from subspace poles, and from those of larger models with the poles taken away that the data
miss least. Black boxes of too low an order have many local minima, and these starts find different
ones. On the hard cases of ``benchmarks/black_box_starts.py`` they leave nothing to descend.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.fitting.black_box.exchange import TRIAL_STEPS, exchanged, pairs_asked_for
from freqid.fitting.black_box.folded_subspace import identified, identify
from freqid.fitting.black_box.held_inputs import inputs_of
from freqid.fitting.black_box.pole_groups import fewer_poles
from freqid.fitting.black_box.rational_lines import (
    FEW,
    FOLLOWED,
    Fitted,
    RationalLines,
    mirrored,
    with_poles,
)
from freqid.fitting.black_box.subspace import observed
from freqid.fitting.cost.experiments import SpectralExperiment, thinned_to
from freqid.lti import StateSpace

# a minimum that was found without a detour and leaves less than this part of the data's energy is
# believed; in more noise than that there may be a better one a little below
_BELIEVED = 0.03
# lines that are enough to come next to the minimum
LINES = 20000
# poles of larger models beyond those that are wanted
_LARGER = (2, 4)
# highest order that begins with all those below
_CHAIN = 12
# poles of one mode, which takes the place that is worth most
_ONE_MODE = 2
# starts with random poles where none of the others is believed
_SCATTERED = 5
# where one more real pole is tried
_REAL_PLACES = (-0.95, -0.7, -0.3, 0.05, 0.3, 0.7, 0.9, 0.98)


def first_model(
    experiments: Sequence[SpectralExperiment],
    order: int,
    feedthrough: bool,
    gain: float = FOLLOWED,
) -> StateSpace:
    """Φ̃, Γ, C, D in the experiments' plane; with one input and output next to the minimum.

    A descent ends with a step that gains the part ``gain`` of the cost. Raises ValueError where the
    lines are too few.
    """
    if not all(e.rational for e in experiments):
        return identify(experiments, order, feedthrough)
    # of very many lines a part will do: its minimum is next to that of all
    few = thinned_to(experiments, LINES)
    lines = RationalLines(few, feedthrough, gain=gain)
    best = best_of(lines, _begun(lines, order))
    if best is not None and few is not experiments:
        lines = RationalLines(experiments, feedthrough, gain=gain)
        best = lines.minimum(best.poles)
    return identify(experiments, order, feedthrough) if best is None else lines.state_space(best)


def roughly(
    experiments: Sequence[SpectralExperiment], order: int, feedthrough: bool
) -> float | None:
    """What the minimum below the likeliest poles alone leaves; None where there is none."""
    if not all(e.single and e.one_to_one for e in experiments):
        return None
    lines = RationalLines(thinned_to(experiments, LINES), feedthrough)
    found = lines.minimum(next(iter(_begun(lines, order))))
    return None if found is None else found.cost * lines.sizes[0] ** 2


def exchanged_model(
    experiments: Sequence[SpectralExperiment], poles: ComplexArray, feedthrough: bool
) -> StateSpace | None:
    """A model that leaves less than the one with these poles, by modes exchanged; or None."""
    if not all(e.single and e.one_to_one for e in experiments):
        return None
    lines = RationalLines(experiments, feedthrough)
    before = lines.below(poles)
    if before is None or before.cost <= lines.rounding:
        return None
    after = exchanged(lines, before)
    return None if after is before else lines.state_space(after)


def with_a_pair(
    experiments: Sequence[SpectralExperiment],
    poles: ComplexArray,
    pairs: Sequence[ComplexArray],
    options: tuple[bool, bool],
    gain: float,
    worth: float,
) -> tuple[StateSpace | None, float]:
    """A model with two poles more than these, and about what it leaves: the best of those begun
    with each of the ``pairs``, with what the residual asks for, and from the data alone.

    ``options`` are feedthrough and stable. None where a short way shows that they do not come below
    a cost ``worth`` more of it. Raises LinAlgError where the polynomials vanish.
    """
    lines = RationalLines(thinned_to(experiments, LINES), *options, gain=gain)
    own, unit = lines.below(poles), lines.sizes[0] ** 2
    if own is None:
        raise np.linalg.LinAlgError("the poles stand for no model")
    tried = [*pairs, *pairs_asked_for(lines, own, 1)[0]]
    met = [lines.below(np.append(own.poles, pair), TRIAL_STEPS) for pair in tried]
    best = min((f for f in met if f is not None), key=lambda f: f.cost, default=own)
    if len(best.poles) == len(poles) or best.cost * unit > worth:
        return None, best.cost * unit
    best = lines.below(best.poles) or best
    other = best_of(lines, _begun(lines, len(poles) + 2))
    best = best if other is None or best.cost <= other.cost else other
    return lines.state_space(best), best.cost * unit


def best_of(
    lines: RationalLines, begun: Iterable[ComplexArray], every: bool = False
) -> Fitted | None:
    """The best minimum from several sets of poles: from ``every`` one, or until one is believed."""
    best: Fitted | None = None
    for poles in begun:
        found = lines.minimum(poles)
        if found is not None and (best is None or found.cost < best.cost):
            best = found
        if not every and found is not None and found is best and _believed(lines, best):
            break
    return best


def nested_model(
    experiments: Sequence[SpectralExperiment],
    order: int,
    feedthrough: bool,
    stable: bool,
    more: int | None = None,
    seed: int = 0,
    count: int = LINES,
) -> StateSpace:
    """As ``first_model``, never above the model of the order below, with so many starts ``more``,
    and on about ``count`` lines until the minimum is near.

    Where these are not counted a few are tried as long as noise leaves no other believed.

    Every order begins on its own and from the poles of the one before with one more; so the cost
    does not rise from one order to the next. ``stable`` models have their poles inside of the unit
    circle. Raises ValueError where the lines are too few.
    """
    if not all(e.single and e.one_to_one for e in experiments):
        return identified_models(experiments, order, feedthrough, stable)[0]
    few = thinned_to(experiments, count)
    lines = RationalLines(few, feedthrough, stable)
    rng = np.random.default_rng(seed)
    best: Fitted | None = None
    if order <= FEW and not more and not stable:
        # few poles that explain nearly all need no others below them
        first = best_of(lines, _begun(lines, order))
        if first is not None and _believed(lines, first) and few is experiments:
            return lines.state_space(exchanged(lines, first) if order > _ONE_MODE else first)
    # of a high order only the last few: the chain from one on would take longer than it is worth
    for n in range(1 if order <= _CHAIN else order - 2, order + 1):
        last = n == order
        extra = _SCATTERED if more is None else more
        scattered = (_random_poles(n, rng) for _ in range(extra * last))
        found = best_of(lines, chain(_begun(lines, n), scattered), every=last and bool(more))
        if best is not None and (found is None or found.cost > best.cost):
            found = min(_one_more(lines, best, n), key=lambda f: f.cost, default=found)
        if found is None:
            break
        best = found
        if best.cost <= lines.rounding and n < order:
            # nothing is left to explain
            best = best_of(lines, _begun(lines, order))
            break
    if best is None or len(best.poles) < order:
        return identify(experiments, order, feedthrough)
    if order > _ONE_MODE or not _believed(lines, best):
        # a way that was straight may have led to a mode that is worth less than another
        best = exchanged(lines, best)
    if few is not experiments:
        lines = RationalLines(experiments, feedthrough, stable)
        best = lines.below(best.poles) or best
    return lines.state_space(best)


def identified_models(
    experiments: Sequence[SpectralExperiment], order: int, feedthrough: bool, stable: bool
) -> list[StateSpace]:
    """Starts of any number of channels and of folded lines, the likeliest first."""
    found = identified(experiments, order, feedthrough)
    if not stable:
        return found
    inner = [(_with_eigenvalues(plain.A, mirrored), plain.C) for plain in found]
    return [inputs_of(experiments, A, C, feedthrough) for A, C in inner]


def scattered_model(
    experiments: Sequence[SpectralExperiment],
    order: int,
    feedthrough: bool,
    rng: np.random.Generator,
) -> StateSpace:
    """A model of any number of channels with random poles, its inputs by least squares."""
    A, _ = with_poles(_random_poles(order, rng))
    C = rng.standard_normal((experiments[0].n_channels[0], order))
    return inputs_of(experiments, A, C, feedthrough)


def _one_more(lines: RationalLines, best: Fitted, order: int) -> list[Fitted]:
    """Minima below a model with one real pole more, for the places where that is worth most."""
    tried = sorted((lines.cost(np.append(best.poles, place)), place) for place in _REAL_PLACES)
    found = [lines.below(np.append(best.poles, place)) for _, place in tried[:2]]
    return [f for f in found if f is not None and len(f.poles) == order]


def _random_poles(order: int, rng: np.random.Generator) -> ComplexArray:
    pairs = order // 2
    upper = rng.uniform(0.7, 0.999, pairs) * np.exp(1j * rng.uniform(0.05, 0.95, pairs) * np.pi)
    poles = np.concatenate([upper, upper.conj()])
    return np.append(poles, rng.uniform(-0.9, 0.9)) if order % 2 else poles


def _with_eigenvalues(A: FloatArray, change: Callable[[ComplexArray], ComplexArray]) -> FloatArray:
    values, V = np.linalg.eig(A)
    return np.real(V @ np.diag(change(values.astype(complex))) @ np.linalg.inv(V))


def _believed(lines: RationalLines, found: Fitted) -> bool:
    if found.cost <= lines.rounding:
        return True
    if not found.straight:
        return False
    return found.cost <= _BELIEVED * lines.energy


def _begun(lines: RationalLines, order: int) -> Iterator[ComplexArray]:
    """Poles to begin from, those that are most likely to do first."""
    nowhere = np.zeros(order, complex)
    if order <= FEW:
        # few poles are found from anywhere
        yield nowhere
    for more in (0, *_LARGER):
        try:
            A, _ = observed(lines.experiments, order + more)
        except InputError:
            # the lines are too few
            if more == 0 and order > FEW:
                raise
            break
        poles = np.linalg.eigvals(A)
        if more == 0:
            yield poles
        elif (larger := lines.minimum(poles)) is not None:
            yield fewer_poles(lines.cost, larger.poles, order)
    if order > FEW:
        yield nowhere
