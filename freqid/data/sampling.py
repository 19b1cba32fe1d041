"""Arithmetic of samples: rates that divide one another, positions in time, trends."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from freqid.checks import FloatArray, InputError, finite, numbers


def check_rates(dt: float, input_dt: float, n_out: int, n_in: int) -> None:
    """ValueError unless there is a whole number of input samples for each output sample."""
    if not np.isfinite(dt * n_out):
        raise InputError(f"dt={dt:g} s makes {n_out} samples last longer than numbers reach")
    factor = dt / input_dt
    M = round(factor)
    if abs(factor - M) > 1e-6 * factor or M < 1:
        raise InputError(
            f"dt={dt:g} must be a whole multiple of input_dt={input_dt:g}; "
            "resample the output first"
        )
    if not M * (n_out - 1) < n_in <= M * n_out:
        raise InputError(
            f"u has {n_in} samples at {input_dt:g} s and y has {n_out} at {dt:g} s; "
            f"expected {M * n_out} samples of u: cut the longer one"
        )


def sample_at(position: float) -> int:
    """The first sample at or after a position; a sample time off by rounding is that sample."""
    return int(np.ceil(position - 1e-6))


def samples_between(
    start: float | None, stop: float | None, dt: float, count: int | None
) -> tuple[int, int | None]:
    """The first sample from ``start`` on and the first from ``stop`` on, both in s.

    Of ``count`` samples, or of as many as come; ValueError where none is left.
    """
    first = 0 if start is None else max(sample_at(finite("start", start) / dt), 0)
    last = count if stop is None else sample_at(finite("stop", stop) / dt)
    if last is not None and count is not None:
        last = min(last, count)
    if last is not None and last - first < 1:
        runs = "on" if count is None else f"to {count * dt:g} s"
        raise InputError(
            f"start={start}, stop={stop} s leave no sample; the record runs from 0 {runs}"
        )
    return first, last


def noise_sizes(y: FloatArray, std: ArrayLike | None, snr: ArrayLike | None) -> FloatArray:
    """Standard deviations of noise on outputs (N, outputs), (outputs,), as ``with_noise`` says."""
    p = y.shape[1]
    if (std is None) == (snr is None):
        raise InputError(f"std={std!r}, snr={snr!r}: give one of them")
    if snr is not None:
        if not y.std(axis=0).all():
            raise InputError(f"snr={snr!r}: an output is constant; give std, the noise's own size")
        ratio = np.atleast_1d(numbers("snr", snr))
        if ratio.shape not in ((1,), (p,)) or not np.isfinite(ratio).all():
            raise InputError(f"snr={snr!r}: expected finite dB, one or one for each of {p} outputs")
        return y.std(axis=0) * 10 ** (-ratio / 20)
    sizes = np.atleast_1d(numbers("std", std if std is not None else ()))
    if sizes.shape not in ((1,), (p,)) or not np.isfinite(sizes).all() or (sizes < 0).any():
        raise InputError(
            f"std={std!r}: expected a finite number that must not be negative, or one for each of "
            f"{p} outputs"
        )
    return np.broadcast_to(sizes, (p,))


def less_trend(x: FloatArray, order: int) -> FloatArray:
    """Samples (N,) or (N, channels) less their least-squares polynomial in time."""
    if order >= len(x):
        raise InputError(f"order={order} must be below the number of samples, {len(x)}")
    basis = np.polynomial.legendre.legvander(np.linspace(-1, 1, len(x)), order)
    flat = x.reshape(len(x), -1)
    return (flat - basis @ np.linalg.lstsq(basis, flat)[0]).reshape(x.shape)
