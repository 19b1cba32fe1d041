"""What a model leaves, tested for structure: whiteness, independence, and the cost's own size."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from freqid.checks import FloatArray, InputError, whole
from freqid.data import (
    AveragedResponse,
    Band,
    DataSet,
    FrequencyResponse,
    PeriodicResponse,
    Record,
    StampedRecord,
    as_band,
)
from freqid.fitting import in_order_of, line_errors, met, offset_is_free
from freqid.lti import Hold
from freqid.models import ModelLike, as_model
from freqid.validation.comparison import Comparison, compare, held, part_inside

if TYPE_CHECKING:
    import pandas as pd

# lags of the correlations, and the level at which a test is failed
_LAGS = 25
_LEVEL = 0.01
# samples for each lag from which on chi-square holds, and how much wider it is in fewer
_LONG, _WIDER = 40, 2.3
# lines that windows of averages tie at the most; local models share more
_WINDOWED = 4
# past values that tell the colour of what is left
_PAST = 4
# lines of a window in which a coherence is taken, and the part of the strongest window's input
# below which one is not driven
_WINDOW, _DRIVEN = 12, 1e-6


def residual_test(
    model: ModelLike,
    record: DataSet,
    *,
    lags: int = _LAGS,
    hold: Hold | str | None = None,
    band: tuple[float, float] | None = None,
) -> pd.DataFrame:
    """Whiteness of what a model leaves, and its independence of the input.

    Rows: ``whiteness`` of each output (Ljung and Box's statistic),
    ``independence`` of each output of each input (the cross-correlations in units of their standard
    error, which the residual's own colour makes wider) and ``coherence`` of the two (what the input
    explains of the residual in windows of a few lines). Columns: test, output, input, statistic,
    limit (99 %), p_value and passed. Of a FrequencyResponse with a variance: ``size`` of what is
    left in units of that, and ``whiteness`` from line to line where lines do not share their noise,
    as those of windowed averages and of local models do. ``attrs["correlations"]`` holds the
    correlations themselves with their limits, which ``plot_residuals`` draws. With ``band`` (Hz)
    only its lines inside are tested. Raises ValueError for fewer samples than four times the
    ``lags``.

    Source: Ljung, System Identification, 1999, section 16.6; with a band, whiteness is Bartlett's
    test of the cumulated periodogram (Priestley, Spectral Analysis and Time Series, 1981, 6.2.5).

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(2000), 1e-3).with_noise(0.1)
    >>> bool(fq.residual_test(fq.first_order(), record)["passed"].all())
    True
    """
    from freqid.validation.residual_table import ResidualTable

    lags = whole("lags", lags)
    if isinstance(record, StampedRecord):
        raise InputError(
            "the tests need samples on a grid: compare() works on the stamps, record.regular() is "
            "resampled"
        )
    if isinstance(record, FrequencyResponse):
        return _of_response(compare(model, record, hold=hold, band=band))
    if not isinstance(record, Record):
        raise InputError(
            f"record={type(record).__name__} is neither a Record nor a response; load() a stream"
        )
    if record.n_samples < 4 * lags:
        raise InputError(f"record has {record.n_samples} samples; {lags} lags need {4 * lags}")
    limits = as_band(band, record.nyquist)
    fitted, hold = held(model, met(model, record), hold, record)
    record = in_order_of(as_model(model), record)
    assert isinstance(record, Record)
    e = -line_errors(fitted, record, hold, offset=offset_is_free(model)).in_time()
    u = record.inputs[:: record.factor][: len(e)]
    N = len(e)
    if limits is not None:
        e, u = part_inside(e, record.dt, limits), part_inside(u, record.dt, limits)
    e, u = e - e.mean(axis=0), u - u.mean(axis=0)
    rows, curves = [], []
    quantile = float(scipy.stats.norm.ppf(1 - _LEVEL / 2))
    # a filtered signal has as many independent values as it has lines
    freedom = N if limits is None else max(2 * (limits.high - limits.low) * N * record.dt, 4.0)
    for o, output in enumerate(record.output_names):
        if limits is not None:
            # a part of a white signal is not white in time: its lines are alike
            statistic = _bartlett(e[:, o], record.dt, limits)
            p = float(scipy.stats.kstwobign.sf(statistic))
            most = float(scipy.stats.kstwobign.isf(_LEVEL))
            rows.append(_row("whiteness", output, "", statistic, most, p))
        auto = _correlation(e[:, o], e[:, o], lags)
        white = auto[lags + 1 :]
        if limits is None:
            q, null = _portmanteau(white, N)
            p, limit = float(null.sf(q)), float(null.isf(_LEVEL))
            rows.append(_row("whiteness", output, "", q, limit, p))
            curves.append(("whiteness", output, "", white, quantile / np.sqrt(N)))
        for i, name in enumerate(record.input_names):
            cross = _correlation(e[:, o], u[:, i], lags)
            # variance of the cross-correlation of independent signals: Σ R_e(τ) R_u(τ) / N
            span = min(N // 4, 2 * lags)
            full = _correlation(e[:, o], e[:, o], span) * _correlation(u[:, i], u[:, i], span)
            spread = np.sqrt(max(float(full.sum()), 1.0) / freedom)
            z = float(np.abs(cross).max() / spread)
            # the largest of so many lags
            count = len(cross)
            p = float(1 - (1 - scipy.stats.norm.sf(z) * 2) ** count)
            most = float(scipy.stats.norm.ppf(1 - (1 - (1 - _LEVEL) ** (1 / count)) / 2))
            rows.append(_row("independence", output, name, z, most, p))
            curves.append(("independence", output, name, cross, most * spread))
            told = _coherence(e[:, o], u[:, i], record.dt, limits)
            if told is not None:
                rows.append(_row("coherence", output, name, *told))
    table = ResidualTable(rows)
    table.attrs["correlations"] = [
        {"test": t, "output": o, "input": i, "values": v.tolist(), "limit": float(lim)}
        for t, o, i, v, lim in curves
    ]
    return table


def _portmanteau(r: FloatArray, N: int) -> tuple[float, Any]:
    """Ljung and Box's statistic of autocorrelations r(1) … r(m), and its distribution where white.

    In short records the sum scatters more than chi-square does, by a part that grows with m/N: a
    gamma distribution of the same mean, its variance found by simulation.
    """
    m = len(r)
    q = N * (N + 2) * float(np.sum(r**2 / (N - np.arange(1, m + 1))))
    if _LONG * m <= N:
        return q, scipy.stats.chi2(m)
    wider = 1 + _WIDER * m / N
    return q, scipy.stats.gamma(m / 2 / wider, scale=2 * wider)


def _coherence(
    e: FloatArray, u: FloatArray, dt: float, band: Band | None
) -> tuple[float, float, float] | None:
    """Statistic, limit and p of what the input explains of the residual, window by window.

    In a window of L lines the coherence γ² of unrelated signals has P(γ² > c) = (1 − c)^(L − 1)
    (Carter, Proc. IEEE 75, 1987), so that −2 (L − 1) Σ ln(1 − γ²) is chi-square with two degrees
    of freedom a window. Noise that drifts leaks from its own low lines into all others, with phases
    that go on from line to line as those of a smooth input do: both are whitened before.
    """
    e, white = _whitened(e, u)
    f = np.fft.rfftfreq(len(e), dt)
    keep = f > 0 if band is None else band.inside(f) & (f > 0)
    # where the input drives is seen of itself, as it is
    E, U, given = (np.fft.rfft(x)[keep] for x in (e, white, u[len(u) - len(e) :]))
    count = len(E) // _WINDOW
    if count < 1:
        return None
    E, U, given = (X[: count * _WINDOW].reshape(count, _WINDOW) for X in (E, U, given))
    power = (np.abs(given) ** 2).sum(axis=1)
    driven = power > _DRIVEN * power.max()
    E, U = E[driven], U[driven]
    own = (np.abs(E) ** 2).sum(axis=1) * (np.abs(U) ** 2).sum(axis=1)
    share = np.abs((E * U.conj()).sum(axis=1)) ** 2 / np.where(own > 0, own, np.inf)
    q = float(-2 * (_WINDOW - 1) * np.log1p(-np.minimum(share, 1 - 1e-12)).sum())
    null = scipy.stats.chi2(2 * len(E))
    return q, float(null.isf(_LEVEL)), float(null.sf(q))


def _whitened(e: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Both through the filter that makes the first one white, as far as so few past values tell
    (Yule and Walker), which changes no coherence.
    """
    if len(e) < _LONG * _PAST or not e.any():
        return e, u
    centred = e - e.mean()
    r = np.array([centred[: len(e) - k] @ centred[k:] for k in range(_PAST + 1)]) / len(e)
    if r[0] <= 0:
        return e, u
    taps = np.concatenate([[1.0], -scipy.linalg.solve_toeplitz(r[:-1] / r[0], r[1:] / r[0])])
    found = [np.convolve(x, taps, "valid") for x in (e, u)]
    return found[0], found[1]


def _of_response(c: Comparison) -> pd.DataFrame:
    """What is left of a response, in units of its own standard error, line by line."""
    from freqid.validation.residual_table import ResidualTable

    frf = c.record
    assert isinstance(frf, FrequencyResponse)
    if frf.variance is None:
        raise InputError("record is a response without variance: there is no noise to test against")
    rows = []
    left = c.residuals / np.sqrt(frf.variance)
    freedom = None
    if isinstance(frf, AveragedResponse | PeriodicResponse):
        freedom = frf.freedom
    for o, output in enumerate(frf.output_names):
        for i, name in enumerate(frf.input_names):
            each = left[o, i]
            K = len(each)
            q, null = _size(np.abs(each) ** 2, freedom), scipy.stats.chi2(2 * K)
            if frf.reach > _WINDOWED and freedom is None:
                q, null = q / (2 * K), _few_lines(K / (frf.reach + 1))
            elif frf.reach:
                # lines of a window go together: as many as are apart
                share = max(K / (frf.reach + 1), 1.0)
                q, null = q * share / K, scipy.stats.chi2(2 * share)
            rows.append(_row("size", output, name, q, float(null.isf(_LEVEL)), float(null.sf(q))))
            if frf.reach or K < 4:
                continue
            along = np.sum(each[1:] * each[:-1].conj()).real
            z = float(np.sqrt(2 * (K - 1)) * along / max(np.sum(np.abs(each) ** 2), 1e-300))
            null = scipy.stats.norm()
            rows.append(
                _row("whiteness", output, name, z, float(null.isf(_LEVEL)), float(null.sf(z)))
            )
    table = ResidualTable(rows)
    table.attrs["correlations"] = []
    return table


def _size(squares: FloatArray, freedom: float | None) -> float:
    """A statistic of K ``squares`` over their variances that is chi-square on 2K degrees.

    Exponentially distributed where the variances are known. Of variances with ``freedom`` ν they
    are F(2, 2ν), P(F > x) = (1 + x/ν)^−ν, and −2 ln P are summed (Fisher, 1925, section 21.1).
    """
    if not freedom:
        return 2 * float(squares.sum())
    return float(2 * freedom * np.log1p(squares / freedom).sum())


def _few_lines(count: float) -> Any:
    """A mean of ``count`` squares over variances that few lines have told, at the least three:
    F(2, 6) of mean 3/2 and variance 27/4.
    """
    return scipy.stats.norm(1.5, np.sqrt(6.75 / max(count, 1.0)))


def _bartlett(e: FloatArray, dt: float, band: Band) -> float:
    """√K times the largest gap between the cumulated periodogram of K lines and a straight line."""
    f = np.fft.rfftfreq(len(e), dt)
    power = np.abs(np.fft.rfft(e)[band.inside(f) & (f > 0)]) ** 2
    share = np.cumsum(power) / max(float(power.sum()), 1e-300)
    K = len(power)
    return float(np.sqrt(K) * np.abs(share - np.arange(1, K + 1) / K).max())


def _row(
    test: str, output: str, input: str, statistic: float, limit: float, p: float
) -> dict[str, object]:
    return {
        "test": test, "output": output, "input": input, "statistic": statistic, "limit": limit,
        "p_value": p, "passed": bool(statistic <= limit),
    }  # fmt: skip


def _correlation(a: FloatArray, b: FloatArray, lags: int) -> FloatArray:
    """Normalised correlation Σ a(t) b(t − τ) for τ from −lags to lags."""
    from scipy.signal import correlate

    size = np.linalg.norm(a) * np.linalg.norm(b)
    full = correlate(a, b, mode="full", method="fft") / (size if size > 0 else 1)
    middle = len(b) - 1
    return np.asarray(full[middle - lags : middle + lags + 1])
