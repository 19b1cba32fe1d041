"""Is the model good enough: simulation against a record, and what is left tested for structure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.stats

from freqid.checks import FloatArray, whole
from freqid.data.record import Record
from freqid.fitting.cost.residuals import line_errors, time_errors
from freqid.fitting.entry import fit
from freqid.fitting.estimate import Estimate
from freqid.lti.holds.hold import Hold

if TYPE_CHECKING:
    import pandas as pd

# lags of the correlations, and the level at which a test is failed
_LAGS = 25
_LEVEL = 0.01


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model beside a record.

    ``measured`` (N, outputs) is the record's output, or its part in the band; ``simulated`` and
    ``residuals`` = measured − simulated are shaped like ``record.y``; ``fit_percent`` (outputs,)
    is 100·(1 − ‖residual‖/‖y − mean‖), the normalised root mean square.
    """

    record: Record
    measured: FloatArray
    simulated: FloatArray
    residuals: FloatArray
    fit_percent: FloatArray
    hold: Hold

    def plot(self, ax: Any = None) -> Any:
        """Measured and simulated outputs above their difference; returns the axes."""
        from freqid.plots.validation_plots import plot_comparison

        return plot_comparison(self, ax)

    def __repr__(self) -> str:
        each = ", ".join(
            f"{n} {f:.2f} %"
            for n, f in zip(self.record.output_names, self.fit_percent, strict=True)
        )
        return f"<Comparison: {each}, input held by {self.hold!r}>"


def compare(
    model: Any,
    record: Record,
    *,
    hold: Hold | str | None = None,
    initial_state: str = "estimate",
    band: tuple[float, float] | None = None,
) -> Comparison:
    """Simulate a model with a record's input, and set the two side by side.

    Args:
        model: an Estimate, a GreyBox, a rational model or a continuous control.StateSpace.
        hold: what the input does; None is what the record remembers, whatever the fit assumed. A
            discrete black box simulates at the hold that it was fitted with.
        initial_state: ``"estimate"`` fits the initial state to this record, ``"steady"`` takes the
            input to be periodic.
        band: in Hz; only what lies inside it is compared, of both. None compares everything.

    Raises ValueError for channels that do not match.

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(500), 1e-3)
    >>> bool(fq.compare(fq.first_order(), record).fit_percent[0] > 99.999)
    True
    """
    if not isinstance(record, Record):
        raise ValueError(f"record={type(record).__name__} is not a Record; compare them one by one")
    hold = _own_hold(model, hold)
    errors = line_errors(model, record, hold, None, initial_state)
    residual = -time_errors(errors, record)
    y = record.outputs[: len(residual)]
    if band is not None:
        y, residual = _inside(y, record.dt, band), _inside(residual, record.dt, band)
    centred = np.linalg.norm(y - y.mean(axis=0), axis=0)
    left = np.linalg.norm(residual, axis=0)
    percent = 100 * (1 - left / np.where(centred > 0, centred, np.inf))
    shape = (len(residual),) if record.y.ndim == 1 else residual.shape
    used = record.hold if hold is None or isinstance(hold, str) else hold
    simulated = (y - residual).reshape(shape)
    return Comparison(record, y, simulated, residual.reshape(shape), percent, used)


def residual_test(
    model: Any,
    record: Record,
    *,
    lags: int = _LAGS,
    hold: Hold | str | None = None,
    band: tuple[float, float] | None = None,
) -> pd.DataFrame:
    """Whiteness of what a model leaves, and its independence of the input.

    Rows: ``whiteness`` of each output (Ljung and Box's statistic of the autocorrelations) and
    ``independence`` of each output of each input (the cross-correlations in units of their standard
    error, which the residual's own colour makes wider). Columns: test, output, input, statistic,
    limit (99 %), p_value and passed. ``attrs["correlations"]`` holds the correlations themselves
    with their limits, which ``plot_residuals`` draws. With ``band`` (Hz) only its lines inside
    are tested. Raises ValueError for fewer samples than four times the ``lags``.

    Source: Ljung, System Identification, 1999, section 16.6; with a band, whiteness is Bartlett's
    test of the cumulated periodogram (Priestley, Spectral Analysis and Time Series, 1981, 6.2.5).

    >>> import freqid as fq
    >>> record = fq.simulate(fq.first_order(), fq.white_noise(2000), 1e-3).with_noise(0.1)
    >>> bool(fq.residual_test(fq.first_order(), record)["passed"].all())
    True
    """
    import pandas as pd

    lags = whole("lags", lags)
    if record.n_samples < 4 * lags:
        raise ValueError(f"record has {record.n_samples} samples; {lags} lags need {4 * lags}")
    hold = _own_hold(model, hold)
    errors = line_errors(model, record, hold, None)
    e = -time_errors(errors, record)
    u = record.inputs[:: record.factor][: len(e)]
    N = len(e)
    if band is not None:
        e, u = _inside(e, record.dt, band), _inside(u, record.dt, band)
    e, u = e - e.mean(axis=0), u - u.mean(axis=0)
    rows, curves = [], []
    quantile = float(scipy.stats.norm.ppf(1 - _LEVEL / 2))
    # a filtered signal has as many independent values as it has lines
    freedom = N if band is None else max(2 * (band[1] - band[0]) * N * record.dt, 4.0)
    for o, output in enumerate(record.output_names):
        if band is not None:
            # a part of a white signal is not white in time: its lines are alike
            statistic = _bartlett(e[:, o], record.dt, band)
            p = float(scipy.stats.kstwobign.sf(statistic))
            most = float(scipy.stats.kstwobign.isf(_LEVEL))
            rows.append(_row("whiteness", output, "", statistic, most, p))
        auto = _correlation(e[:, o], e[:, o], lags)
        white = auto[lags + 1 :]
        q = N * (N + 2) * float(np.sum(white**2 / (N - np.arange(1, lags + 1))))
        limit = float(scipy.stats.chi2.ppf(1 - _LEVEL, lags))
        if band is None:
            p = float(scipy.stats.chi2.sf(q, lags))
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
    table = pd.DataFrame(rows)
    table.attrs["correlations"] = [
        {"test": t, "output": o, "input": i, "values": v.tolist(), "limit": float(lim)}
        for t, o, i, v, lim in curves
    ]
    return table


def _bartlett(e: FloatArray, dt: float, band: tuple[float, float]) -> float:
    """√K times the largest gap between the cumulated periodogram of K lines and a straight line."""
    f = np.fft.rfftfreq(len(e), dt)
    power = np.abs(np.fft.rfft(e)[(f >= band[0]) & (f <= band[1]) & (f > 0)]) ** 2
    share = np.cumsum(power) / max(float(power.sum()), 1e-300)
    K = len(power)
    return float(np.sqrt(K) * np.abs(share - np.arange(1, K + 1) / K).max())


def _row(
    test: str, output: str, input: str, statistic: float, limit: float, p: float
) -> dict[str, Any]:
    return {
        "test": test, "output": output, "input": input, "statistic": statistic, "limit": limit,
        "p_value": p, "passed": bool(statistic <= limit),
    }  # fmt: skip


def _own_hold(model: Any, hold: Hold | str | None) -> Hold | str | None:
    """The hold asked for, or the one that a sampled model has inside."""
    inner = getattr(model, "model", model)
    sampled = hasattr(inner, "matrices") and hasattr(inner, "hold")
    return inner.hold if hold is None and sampled else hold


def _inside(x: FloatArray, dt: float, band: tuple[float, float]) -> FloatArray:
    """The part of signals (N, channels) inside a band in Hz."""
    X, f = np.fft.rfft(x, axis=0), np.fft.rfftfreq(len(x), dt)
    X[(f < band[0]) | (f > band[1])] = 0
    return np.fft.irfft(X, len(x), axis=0)


def _correlation(a: FloatArray, b: FloatArray, lags: int) -> FloatArray:
    """Normalised correlation Σ a(t) b(t − τ) for τ from −lags to lags."""
    from scipy.signal import correlate

    size = np.linalg.norm(a) * np.linalg.norm(b)
    full = correlate(a, b, mode="full", method="fft") / (size if size > 0 else 1)
    middle = len(b) - 1
    return np.asarray(full[middle - lags : middle + lags + 1])


def cost_test(est: Estimate) -> dict[str, float]:
    """Cost of a fit with known noise (weights 1/variance) against what the noise explains.

    2·V is then chi-square with as many degrees of freedom as real values less parameters (Pintelon
    and Schoukens, 2012, section 11.4.3). Returns cost, expected, ratio and p_value: a small p says
    that the model is too simple, one next to 1 that the variances are too large.
    """
    freedom = max(est.n_rows - len(est.names), 1)
    # a complex error of unit variance has half of it in each of its parts
    twice = 2 * est.cost
    return {
        "cost": float(est.cost),
        "expected": freedom / 2,
        "ratio": float(twice / freedom),
        "p_value": float(scipy.stats.chi2.sf(twice, freedom)),
    }


def hold_bias(
    est: Estimate,
    data: Record | Sequence[Record],
    *,
    band: tuple[float, float] | None = None,
    weights: Any = None,
) -> pd.DataFrame:
    """The bias bar: what the assumed hold has added to each parameter of a grey-box estimate.

    The same model is fitted with the hold that the records remember, ``band`` and ``weights`` being
    those of the estimate; ``bias`` is the estimate less
    that, to be drawn beside ``std``, the error bar of the noise. Columns estimate, remembered,
    bias and std; the ratio of bias to std says which of the two rules.
    """
    import pandas as pd

    start = {p.name: p.value for p in est.model.free_parameters}
    nominal = dict(zip(est.names, est.nominal, strict=True))
    usable = {n: v for n, v in nominal.items() if n in start and np.isfinite(v)}
    model = est.model.with_values(**usable)
    remembered = fit(model, data, band=band, weights=weights)
    names = [n for n in est.names if n in remembered.names]
    index = pd.Index(names, name="parameter")
    estimate = pd.Series([est[n] for n in names], index=index)
    other = pd.Series([remembered[n] for n in names], index=index)
    std = est.parameters["std"].reindex(index)
    return pd.DataFrame(
        {"estimate": estimate, "remembered": other, "bias": estimate - other, "std": std}
    )


def cross_validate(model: Any, records: Sequence[Record], **options: Any) -> pd.DataFrame:
    """Fit to all repeats but one, and compare with that one, each in turn.

    ``options`` go to ``fit``. Returns a DataFrame with one row a repeat: ``held_out``, the fit in
    per cent of each output, and the parameters. Raises ValueError for fewer than two records.
    """
    import pandas as pd

    sets = list(records)
    if len(sets) < 2:
        raise ValueError(f"records holds {len(sets)}; cross-validation needs two or more repeats")
    rows = []
    for i, held_out in enumerate(sets):
        est = fit(model, [r for k, r in enumerate(sets) if k != i], **options)
        fits = compare(est, held_out).fit_percent
        named = {f"fit {n}": float(v) for n, v in zip(held_out.output_names, fits, strict=True)}
        rows.append({"held_out": i, **named, **dict(zip(est.names, est.values, strict=True))})
    return pd.DataFrame(rows)


def bootstrap(
    model: Any, records: Sequence[Record], n: int = 200, seed: int = 0, **options: Any
) -> pd.DataFrame:
    """Estimates from repeats drawn again with replacement: their scatter without a noise model.

    ``options`` go to ``fit``; each resample starts from the estimate of all repeats. Returns a
    DataFrame (n, parameters) whose ``describe`` and ``quantile`` give error bars. Raises ValueError
    for fewer than three records.

    Source: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 6.
    """
    import pandas as pd

    sets, count = list(records), whole("n", n)
    if len(sets) < 3:
        raise ValueError(f"records holds {len(sets)}; a bootstrap needs three or more repeats")
    rng = np.random.default_rng(whole("seed", seed, least=0))
    whole_fit = fit(model, sets, **options)
    if "start" not in options and hasattr(whole_fit.model, "values"):
        free = [p.name for p in whole_fit.model.free_parameters]
        options = {**options, "start": {k: whole_fit[k] for k in free}, "n_starts": 1}
    rows = []
    for _ in range(count):
        drawn = [sets[i] for i in rng.integers(0, len(sets), len(sets))]
        rows.append(fit(model, drawn, **options).values)
    return pd.DataFrame(rows, columns=list(whole_fit.names))
