"""Clocks: what time stamps say of the clock that made them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError, IntArray
from freqid.data.printed_times import printed_digit, printed_period

# denominators of a ratio that two clocks are believed to have, smallest first
_DENOMINATORS = 64
# part of a period that stamps of a calm clock are off by, and how fast a phase follows the others
_CALM, _FOLLOWING = 0.4, 0.1
# part of a period that stamps of even ticks are off by, of stamps and of the program that made them
_STEADY = 0.1
# part of one that may be no drift between clocks of which one is even and stamped badly
_EVEN = 0.5
# a period's and a start's part that rounding hides at best
_DIGITS, _EXACT = 1e-13, 1e-7
# rows on either side of where a time begins anew
_ANEW = 10
# ticks for each stamp from which on missing ones are doubted, how many are tried instead, and the
# digits over which rounded stamps scatter about the line of their clock
_MANY, _TRIED, _ROUNDED = 1.05, 200, 1.1


def begins_anew(times: FloatArray) -> int | None:
    """The row in which times go back to where they were many rows before, as where a file holds
    two experiments, one after another; None where they do not.
    """
    if len(times) < 2 * _ANEW or not np.isfinite(times).all():
        return None
    steps = np.diff(times)
    back = np.flatnonzero(steps < 0) + 1 if np.median(steps) > 0 else ()
    for row in back:
        if _ANEW <= row <= len(times) - _ANEW:
            later = times[row : row + _ANEW]
            if later[0] <= times[row - _ANEW] and later.max() <= times[row - 1]:
                return int(row)
    return None


def out_of_order(name: str, times: FloatArray, row: int) -> InputError:
    """The error for times that do not increase, first in that row."""
    anew = begins_anew(times)
    if anew is not None:
        return InputError(
            f"{name} begins anew in row {anew}, at {times[anew]:g} s after {times[anew - 1]:g} s: "
            "one experiment after another, each of which needs a file, or a table, of its own: "
            f"rows 0 to {anew - 1}, and from {anew} on"
        )
    return InputError(
        f"{name} does not increase in row {row}: it goes back or stands still, at {times[row]:g} s "
        f"after {times[row - 1]:g} s; sort or repair the rows"
    )


@dataclass(frozen=True, eq=False)
class Clock:
    """A line through stamps: sample ``number`` k comes at ``start`` + k·``period`` (s).

    ``jitter`` is the rms distance of the stamps from the line and ``worst`` the largest, both in
    periods; ``missing`` counts samples that never came; ``digit`` in s is what stamps of an even
    clock were rounded to, 0 where they were not. An ``even`` clock ticks whatever its stamps say.
    """

    stamps: FloatArray
    number: IntArray
    start: float
    period: float
    jitter: float
    worst: float
    missing: int
    digit: float = 0.0
    even: bool = False

    @classmethod
    def of(cls, name: str, stamps: ArrayLike) -> Clock:
        """Of stamps in s; ValueError unless they increase."""
        t = np.array(stamps, dtype=float)
        if t.ndim != 1 or len(t) < 3 or not np.isfinite(t).all():
            raise InputError(f"{name} must be three finite times in s, (N,), or more")
        gaps = np.diff(t)
        printed = printed_period(t)
        if printed is not None:
            return cls._rounded(t, *printed)
        if (gaps <= 0).any():
            raise out_of_order(name, t, int(np.argmax(gaps <= 0)) + 1)
        number = _numbered(t - t[0], gaps)
        kept = np.ones(len(t), bool)
        for _ in range(5):
            period, start = np.polyfit(number[kept], t[kept] - t[0], 1)
            left = t - t[0] - start - period * number
            size = 1.4826 * float(np.median(np.abs(left - np.median(left))))
            kept = np.abs(left) <= max(5 * size, 1e-12 * abs(period))
            if kept.sum() < 3:
                break
        off = np.abs(left) / period
        rms = float(np.sqrt(np.mean(off**2)))
        missing = int(number[-1] + 1 - len(t))
        # the last digits are rounding of the stamps
        period, start = float(f"{period:.13g}"), float(f"{t[0] + start:.13g}")
        return cls(t, number, start, period, rms, float(off.max()), missing)

    @classmethod
    def _rounded(cls, t: FloatArray, period: float, digit: float) -> Clock:
        """An even clock whose stamps have few digits."""
        number = np.arange(len(t))
        left = t - period * number
        # halfway between the extremes, which rounding to a digit keeps within one
        start = float(left.min() + left.max()) / 2
        off = np.abs(left - start) / period
        rms = float(np.sqrt(np.mean(off**2)))
        return cls(t, number, start, period, rms, float(off.max()), 0, digit)

    @property
    def calm(self) -> bool:
        """Whether its ticks are even: its stamps are off by little, or it is said."""
        return self.even or bool(self.digit) or self.worst <= _STEADY

    @property
    def times(self) -> FloatArray:
        """When the samples were: at even ticks, or of a clock that jitters when its stamps say."""
        return self.ticks if self.calm else self.stamps

    @property
    def ticks(self) -> FloatArray:
        """When the samples were if the clock ticks evenly."""
        return self.start + self.period * self.number

    def ticking(self, earliest: bool) -> Clock:
        """The same where its ticks are even: amid the stamps, or where these can only be late."""
        early = float((self.stamps - self.ticks).min()) if earliest else 0.0
        return dataclasses.replace(self, start=self.start + early, even=True)

    @property
    def standard_error(self) -> float:
        """Of the period, as a part of it."""
        spread = float(np.std(self.number)) * np.sqrt(len(self.number))
        return max(self.jitter / max(spread, 1e-300), _DIGITS)

    @property
    def start_error(self) -> float:
        """Standard error of the start in s: that of a line at its end."""
        return max(2 * self.jitter / np.sqrt(len(self.number)), _EXACT) * self.period

    def sentence(self, name: str) -> str:
        """The clock in words."""
        said = f"{name}: {1 / self.period:.9g} Hz, "
        if self.digit:
            return said + f"stamps rounded to {self.digit:g} s"
        said += f"jitter {100 * self.jitter:.3g} % of a period"
        if self.worst > 2 * self.jitter:
            said += f", at most {100 * self.worst:.3g} %"
        return said + (f", {self.missing} samples missing" if self.missing else "")


def _numbered(t: FloatArray, gaps: FloatArray) -> IntArray:
    """Number of the tick of each stamp: gaps in periods, or where these jitter, ticks followed."""
    period = float(np.median(gaps))
    steps = np.maximum(np.round(gaps / period), 1).astype(int)
    if float(np.abs(gaps / period - steps).max()) < _CALM:
        number = np.concatenate([[0], np.cumsum(steps)])
        fewer = _of_rounded(t, int(number[-1])) if number[-1] > _MANY * len(t) else None
        return number if fewer is None else fewer
    # nothing missing: then no stamp is a whole period off the line through all of them
    every = np.arange(len(t))
    line = np.polyfit(every, t, 1)
    if float(np.abs(t - np.polyval(line, every)).max()) < 0.5 * line[0]:
        return every
    for _ in range(2):
        number = _followed(t, period)
        period, start = np.polyfit(number, t, 1)
    nearest = np.round((t - start) / period).astype(int)
    # the nearest tick, unless two stamps share one
    number = nearest - nearest[0] if (np.diff(nearest) > 0).all() else number
    # stamps that are late by more than half a period seem to skip ticks
    return every if _off(every, t) <= _off(number, t) else number


def _of_rounded(t: FloatArray, most: int) -> IntArray | None:
    """Ticks of an even clock whose stamps were rounded to a digit, the fewest missing, not half of
    those of ``most``; None where no such clock is told.

    Steps of 1 and 2 ms are those of 1.4 ms, and of 1 ms with many ticks missing where no line lies
    within half a digit of all.
    """
    digit = printed_digit(t)
    if digit is None:
        return None
    none = len(t) - 1
    for last in range(none, none + min((most - none) // 2, _TRIED)):
        number = np.round((t - t[0]) * (last / t[-1])).astype(int)
        if (np.diff(number) > 0).all():
            line = np.polyfit(number, t, 1)
            if float(np.ptp(t - np.polyval(line, number))) <= _ROUNDED * digit:
                return number
    return None


def _off(number: IntArray, t: FloatArray) -> float:
    """Rms distance of stamps from the line through them, in its periods."""
    line = np.polyfit(number, t, 1)
    return float(np.sqrt(np.mean((t - np.polyval(line, number)) ** 2)) / line[0])


def _followed(t: FloatArray, period: float) -> IntArray:
    """Ticks counted by a phase that follows the stamps slowly, so that jitter averages out."""
    number, phase, ticks = 0, 0.0, [0]
    for stamp in t[1:].tolist():
        count = max(round((stamp - phase) / period), 1)
        number += count
        phase += count * period
        phase += _FOLLOWING * (stamp - phase)
        ticks.append(number)
    return np.array(ticks)


def simple_ratio(slow: Clock, fast: Clock) -> Fraction | None:
    """slow.period / fast.period as the simplest fraction that the stamps do not contradict; None
    where there is none: a clock that drifts by a hundredth of a period is told from one that not.
    """
    ratio, length = slow.period / fast.period, max(int(slow.number[-1]), 1)
    error = 4 * ratio * np.hypot(slow.standard_error, fast.standard_error)
    # and no drift is believed that is nothing, or not, that is a tenth of a period, or half of one
    # where stamps that are far off tell it
    most = _EVEN if slow.even or fast.even else _STEADY
    allowed = np.clip(error * length, _EXACT, most * min(1.0, ratio))
    for denominator in range(1, _DENOMINATORS + 1):
        found = Fraction(round(ratio * denominator), denominator)
        if found > 0 and abs(float(found) - ratio) * length < allowed:
            return found
    return None
