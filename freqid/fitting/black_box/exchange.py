"""One mode for another: out of a rational function's minimum where a different one is worth more.

A black box of a fixed order explains the strongest modes that its descent has met. Where another
one, which it has not, explains more than the weakest of them, no descent gets there: in between
the cost is higher. So a mode is added where what is left asks for one, and the least missed of all
is taken away.
"""

from __future__ import annotations

import numpy as np

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.black_box.pole_groups import fewer_poles, in_groups, joined
from freqid.fitting.black_box.rational_lines import Fitted, RationalLines

# how often modes are exchanged at the most, how many are tried each time, and the least gain
_ROUNDS, _TRIED, _GAIN = 4, 4, 1e-4
# places of narrow modes, half as wide as so many lines, and of wide ones at so many radii
_NARROW, _LINES_WIDE, _WIDE, _RADII = 160, 2.0, 24, (0.6, 0.9, 0.97)
# where no mode explains this part of what the least missed one is worth none takes its place
_WORTH = 0.05
# steps of a descent on trial
TRIAL_STEPS = 12
# poles that are closer than this part of their distance from the circle are one
_NEAR = 0.5
# real poles that are tried
REAL = (-0.9, -0.5, 0.2, 0.5, 0.8, 0.95, 0.99)


def exchanged(lines: RationalLines, best: Fitted) -> Fitted:
    """The least minimum to which exchanges of one mode lead, ``best`` itself where none does."""
    order, first = len(best.poles), best
    for _ in range(_ROUNDS):
        before = best.cost
        for added in _asked_for(lines, best):
            larger = lines.below(np.append(best.poles, added), TRIAL_STEPS)
            if larger is None:
                continue
            poles = fewer_poles(lines.cost, larger.poles, order)
            found = None if _same(poles, best.poles) else lines.below(poles, TRIAL_STEPS)
            if found is not None and found.cost < best.cost and len(found.poles) == order:
                best = found
        if best.cost > before * (1 - _GAIN):
            break
    return best if best is first else lines.below(best.poles) or best


def _same(poles: ComplexArray, others: ComplexArray) -> bool:
    """Whether poles lie where others do, compared to how far these are from the circle."""
    if len(poles) != len(others):
        return False
    apart = np.abs(poles[:, None] - others)
    return bool((apart.min(axis=1) <= _NEAR * np.abs(1 - np.abs(poles))).all())


def _least_worth(lines: RationalLines, best: Fitted) -> float:
    """What the cost rises by without the real pole, or the pair, that is least missed; of one alone
    nothing, for what stands next to it is not all that it explains.
    """
    groups = in_groups(best.poles)
    if len(groups) == 1:
        return 0.0
    rest = [joined(groups[:i] + groups[i + 1 :]) for i in range(len(groups))]
    return min(map(lines.cost, rest)) - best.cost


def _asked_for(lines: RationalLines, best: Fitted) -> list[ComplexArray]:
    """The pairs, and the real pole, that explain most of what is left, one for each place; none
    where each explains little beside the mode whose place it would take.
    """
    real = np.array(REAL, complex)
    costs = [lines.cost(np.append(best.poles, r)) for r in real]
    pairs, most = pairs_asked_for(lines, best, _TRIED)
    if max(most, best.cost - min(costs)) < _WORTH * _least_worth(lines, best):
        return []
    return [*pairs, real[[int(np.argmin(costs))]]]


@np.errstate(all="ignore")
def pairs_asked_for(
    lines: RationalLines, best: Fitted, count: int
) -> tuple[list[ComplexArray], float]:
    """So many pairs of poles that explain most of what is left, one for each place, and how much
    of the cost the first of them does.
    """
    pairs = candidates(lines.w)
    gains = _gains(lines, lines.residual(best), pairs)
    picked = [np.array([p, p.conj()]) for p in pairs[most_of(pairs, gains, count)]]
    return picked, float(gains.max(initial=0.0))


def most_of(poles: ComplexArray, gains: FloatArray, count: int) -> list[int]:
    """Numbers of so many poles that gain most, one for each place."""
    picked: list[int] = []
    for i in np.argsort(-gains):
        p = poles[i]
        near = [abs(p - q) < 2 * max(1 - abs(p), 1 - abs(q)) for q in poles[picked]]
        if not any(near):
            picked.append(int(i))
        if len(picked) == count:
            break
    return picked


def candidates(w: ComplexArray) -> ComplexArray:
    """Poles next to lines, as wide as a few of them, and wide ones all over the circle."""
    angle = np.unique(np.abs(np.angle(w)))
    angle = angle[(angle > 0) & (angle < np.pi)]
    if len(angle) < 3:
        return np.zeros(0, complex)
    width = np.clip(_LINES_WIDE * np.gradient(angle), 1e-6, 0.5)
    at = np.unique(np.linspace(0, len(angle) - 1, _NARROW).astype(int))
    narrow = np.exp(1j * angle[at]) * (1 - width[at])
    spread = angle[np.unique(np.linspace(0, len(angle) - 1, _WIDE).astype(int))]
    wide = np.outer(_RADII, np.exp(1j * spread)).ravel()
    return np.concatenate([narrow, wide])


def _gains(lines: RationalLines, left: ComplexArray, poles: ComplexArray) -> FloatArray:
    """What a pair of poles alone explains of what is left, (poles,)."""
    w = lines.w
    # the columns of the numerator's two terms are s and s w: all sums of products from those of s
    s = lines.driven / ((w - poles[:, None]) * (w - poles[:, None].conj()))
    power = np.square(s.real) + np.square(s.imag)
    a, c, b = (power @ np.array([np.ones(len(w)), w.real, np.abs(w) ** 2]).T).T
    x, y = (s @ np.array([left.conj(), w * left.conj()]).T).real.T
    gains = (b * x**2 - 2 * c * x * y + a * y**2) / (a * b - c**2)
    return np.where(np.isfinite(gains), gains, 0)
