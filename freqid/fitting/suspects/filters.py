"""A filter that was forgotten, in place of the delay or the hold that it looks like.

An amplifier, a current loop or a sensor's low-pass lags, which slow motions take for a delay; a
sensor that is coupled by a capacitor is a high-pass, whose lead looks like an input that knows what
comes. Each is one unknown more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import Array, InputError
from freqid.data import DataSet
from freqid.fitting.estimate import Estimate
from freqid.fitting.findings import Finding
from freqid.fitting.fitters import SearchOptions, fitter_of
from freqid.fitting.suspects.asking import Asking
from freqid.fitting.suspects.scene import Scene
from freqid.models import GreyBox, Parameter, wrapped

# the filter's own unknown, a time in s; times of a lag, in those of the delay that it looks like,
# and of a high-pass, in the period of the slowest line
_NAME, _TIMES, _SLOW = "time of a filter", (1.0, 0.3), (1.0, 10.0)
# how far below the slowest line a high-pass may lie, and any filter from where it begins: beyond it
# is none, and its matrices are not finite
_SEEN, _WIDE = 2.0, 1e3


@dataclass(frozen=True)
class _Filter:
    """One of a time T (s), of ``order`` 1 (1/(1 + Ts)) or 2 (Butterworth's), or what the first one
    leaves (Ts/(1 + Ts)), ``high``; of all inputs, of one ``input``, or of an ``output`` (numbers).
    """

    order: int = 1
    high: bool = False
    output: int | None = None
    input: int | None = None

    def states(self, T: complex) -> tuple[Array, Array, Array]:
        """Its matrices A (n, n), B (n, 1) and C (1, n)."""
        if self.order == 1:
            return np.array([[-1 / T]]), np.array([[1 / T]]), np.array([[1.0]])
        A = np.array([[0, 1], [-1, -np.sqrt(2)]]) / T
        return A, np.array([[0], [1 / T]]), np.array([[1.0, 0.0]])

    def around(self, plant: Callable[..., Sequence[object]]) -> Callable[..., Sequence[Array]]:
        """The plant's matrices with its states."""

        def matrices(**values: object) -> Sequence[Array]:
            a, b, c = self.states(values.pop(_NAME))  # type: ignore[arg-type]
            A, B, C, D = plant(**values)
            A, B, C = np.asarray(A), np.asarray(B), np.asarray(C)
            p, m = len(C), B.shape[1]
            D = np.zeros((p, m)) if D is None else np.asarray(D)
            D = D if D.ndim else np.zeros((p, m))
            if self.output is None:
                own = np.eye(m) if self.input is None else np.eye(m)[:, [self.input]]
                one, rest = np.eye(own.shape[1]), np.eye(m) - own @ own.T
                a, b, c = np.kron(one, a), np.kron(one, b), own @ np.kron(one, c)
                corner = np.zeros((len(a), len(A)))
                whole = np.block([[A, B @ c], [corner, a]])
                return whole, np.vstack([B @ rest, b @ own.T]), np.hstack([C, D @ c]), D @ rest
            seen = np.arange(p)[:, None] == self.output
            whole = np.block([[A, np.zeros((len(A), len(a)))], [b @ C[[self.output]], a]])
            kept = 1.0 * (~seen | self.high)
            own = np.where(seen, -c if self.high else c, 0 * c)
            inputs = np.vstack([B, b @ D[[self.output]]])
            return whole, inputs, np.hstack([kept * C, own]), kept * D

        return matrices

    def words(self, T: float, data: DataSet) -> str:
        """What it is, and where."""
        where = "at the inputs" if len(data.input_names) > 1 else "at the input"
        if self.output is not None:
            where = f"at output {data.output_names[self.output]!r}"
        if self.input is not None:
            where = f"at input {data.input_names[self.input]!r}"
        hertz = f"{1 / (2 * np.pi * T):.3g} Hz"
        if self.high:
            return f"a high-pass of {hertz} {where} (a sensor that is AC-coupled)"
        if self.order > 1:
            return f"a low-pass of second order and {hertz} {where} (an anti-alias filter)"
        return f"a lag of {T:.3g} s {where} (an amplifier, a current loop, a filter, a sensor)"


def filter_instead(
    inquiry: Asking, scene: Scene, begun: GreyBox, seconds: float, left: float, whole: float = 0.0
) -> list[Finding]:
    """A finding where one filter leaves less than this part ``left`` of the data's energy, or less
    than ``whole`` and nothing that a black box explains: a lag of about so many ``seconds``, or
    where these are none a high-pass.
    """
    data = inquiry.readings[0].data
    outputs, inputs = len(data.output_names), begun.n_inputs
    slowest = min(float(s.omega_input[s.omega_input > 0].min()) for s in scene.seen)
    if seconds > 0:
        # of one output a lag before it is one behind the input
        filters = [_Filter(), _Filter(2)]
        filters += [_Filter(output=i) for i in range(outputs) if outputs > 1]
        filters += [_Filter(input=i) for i in range(inputs) if inputs > 1]
        times = [seconds * part for part in _TIMES]
    else:
        filters = [_Filter(high=True, output=i) for i in range(outputs)]
        times = [2 * np.pi / slowest * part for part in _SLOW]
    best: tuple[float, float, _Filter, Estimate] | None = None
    for one in filters:
        for time in times:
            try:
                own = Parameter(_NAME, time, "s", lower=time / _WIDE, upper=time * _WIDE)
                model = wrapped(begun, one.around, own)
                est = fitter_of(model)(model, inquiry.readings, SearchOptions(n_starts=1))
            except (InputError, np.linalg.LinAlgError, ArithmeticError):
                continue
            share = est.minimum.cost / max(est.minimum.objective.energy, 1e-300)
            if one.high and slowest * est[_NAME] > _SEEN:
                # it passes all that there is
                continue
            if share < max(left, whole) and (best is None or share < best[0]):
                best = share, est[_NAME], one, est
    if best is None:
        return []
    share, time, one, est = best
    if share >= left and est.witness.verdict != "complete":
        return []
    text = (
        f"{one.words(time, data)} explains what looks like "
        f"{'a hold that looks ahead' if one.high else 'a delay'}: so "
        f"{100 * (1 - np.sqrt(share)):.4g} % of the data are explained; give the model that"
    )
    return [Finding("high-pass" if one.high else "lag", text, number=float(share))]
