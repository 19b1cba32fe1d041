"""Periods of an excitation: found, and checked where they are given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError, steps
from freqid.data import Record, Stream

# a lag at which a signal repeats itself so well is a period
_REPEATS = 0.9
# multiples of a period that is given, of which one may be the true one
_MULTIPLES = 12
# a period that repeats less than this part of what a multiple does is wrong, and so little, none
_WORSE, _NOT_AT_ALL = 0.75, 0.05
# periods of a stream that show whether they are such, and samples in which one is looked for
PERIODS_SHOWN, _SEARCHED = 2 * _MULTIPLES, 1 << 20


def samples_of_a_period(
    sets: Sequence[Record | Stream], signals: Sequence[FloatArray] | None, period: float | None
) -> int:
    """Samples of a period, given or found; ValueError where there is none."""
    first = sets[0]
    if period is not None:
        return steps("period", period, first.dt, least=2)
    if signals is not None:
        return _repeat(signals[0][:, 0])
    shown = first.load(_SEARCHED) if isinstance(first, Stream) else first
    fine, M = _repeat(shown.inputs[:, 0]), first.factor
    if fine % M:
        raise InputError(
            f"the excitation repeats after {fine * first.dt / M:g} s, which is no whole number "
            f"of the output's samples of {first.dt:g} s; make it one"
        )
    return fine // M


def _repeat(x: FloatArray) -> int:
    """Samples after which a signal repeats itself; ValueError where it does not."""
    x = x - x.mean()
    N = len(x)
    size = scipy.fft.next_fast_len(2 * N)
    r = scipy.fft.irfft(np.abs(scipy.fft.rfft(x, size)) ** 2, size)[: N // 2 + 1]
    # energies of the two parts that a lag compares
    energy = np.cumsum(x**2)
    lags = np.arange(1, len(r))
    early, late = energy[N - 1 - lags], energy[-1] - energy[lags - 1]
    alike = np.concatenate([[1.0], r[1:] / np.sqrt(np.maximum(early * late, 1e-300))])
    # beyond the first fall, so that a smooth signal is no period of one sample
    fallen = np.flatnonzero(alike < 0.5)
    found = np.flatnonzero(alike > _REPEATS)
    found = found[found > (fallen[0] if len(fallen) else len(r))]
    if not len(found):
        raise InputError("the excitation does not repeat itself; give period= in s")
    near = found[found <= found[0] * 1.05 + 2]
    return int(near[np.argmax(alike[near])])


def check_period(name: str, x: FloatArray, n: int, period: float) -> None:
    """ValueError where n samples, a period in s, do not repeat, or a multiple does much better."""
    own = _repeats(x, n)
    for m in range(2, min(len(x) // n // 2, _MULTIPLES) + 1):
        better = _repeats(x, m * n)
        if better > _REPEATS and own < _WORSE * better:
            raise InputError(
                f"{name}: the excitation repeats after {m * period:g} s; after period={period:g} s "
                f"only {100 * max(own, 0):.0f} % of its power does; give period={m * period:g}"
            )
    if len(x) >= 2 * n and own < _NOT_AT_ALL:
        raise InputError(
            f"{name}: only {100 * max(own, 0):.0f} % of the excitation's power repeats after "
            f"period={period:g} s; give that of all records"
        )


def _repeats(x: FloatArray, n: int) -> float:
    """Part of a signal's power (samples, channels) that n samples repeat; about 0 for noise."""
    P = len(x) // n
    rows = x[: P * n].reshape(P, n, x.shape[1])
    power = float((rows**2).mean()) if P >= 2 else 0.0
    if not power:
        return 0.0
    share = float((rows.mean(axis=0) ** 2).mean()) / power
    return (P * share - 1) / (P - 1)
