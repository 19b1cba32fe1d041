"""Bias without data: against closed forms, the paper, finer quadrature and long simulations."""

import control
import numpy as np
import pytest
import scipy.signal

import freqid as fq
from freqid.bias import conditions

T1 = 0.5e-3
TRUE = fq.ZeroOrderHold(T1)


def test_the_papers_first_order_examples_in_closed_form():
    """Theory §10: eq. 3 and eq. 6, one line at 50 rad/s."""
    line = fq.LineSpectrum([50 / (2 * np.pi)], [1.0])
    for hold, b, a in (("zoh", 135.1141, 142.9504), ("foh", 98.0526, 96.9163)):
        est = fq.asymptotic_fit(fq.first_order(), line, 5e-3, hold, TRUE)
        assert est["b"] == pytest.approx(b, abs=5e-5)
        assert est["a"] == pytest.approx(a, abs=5e-5)


@pytest.mark.parametrize(
    ("hold", "expected"),
    [
        ("zoh", [9.746e-4, 1.9488e5, 15.905, 63.14e-3, -230.94]),
        ("foh", [8.2649e-4, 1.34032e5, 9.5975, -4.033e-3, 23.301]),
    ],
)
def test_table_2_in_steady_state(plant, hold, expected):
    lines = fq.LineSpectrum(np.linspace(10, 80, 701), np.ones(701))
    est = fq.asymptotic_fit(plant, lines, 5e-3, hold, TRUE)
    assert np.allclose(est.values, expected, rtol=1e-4)
    frf = plant.frequency_response(2 * np.pi * np.linspace(10, 80, 701), TRUE)
    measured = fq.FrequencyResponse(frf.frequency, frf.response, dt=5e-3)
    assert np.allclose(est.values, fq.fit(plant, measured, hold=hold).values, rtol=1e-6)


def test_the_remembered_hold_has_no_bias(plant):
    for spectrum in (fq.ChirpSpectrum(1, 99), fq.ChirpSpectrum(10, 80, "log"),
                     fq.MultisineSpectrum((1, 90), 10.0)):  # fmt: skip
        est = fq.asymptotic_fit(plant, spectrum, 5e-3, None, TRUE)
        assert max(abs(est[n] / plant[n] - 1) for n in est.names) < 1e-9
        assert est.warnings == []


@pytest.mark.study
@pytest.mark.parametrize("factor", [5, 20])
@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize(
    "spectrum", [fq.ChirpSpectrum(10, 80), fq.FilteredSpectrum(([0.1], [1, -0.9]))]
)
def test_quadrature_against_a_hundred_times_as_many_nodes(
    plant, monkeypatch, factor, hold, spectrum
):
    est = fq.asymptotic_fit(plant, spectrum, factor * T1, hold, TRUE)
    coarse = conditions.resolved

    def fine(panels, functions):
        panels = coarse(panels, functions)
        edges = np.linspace(panels[:, 0], panels[:, 1], 101)
        return np.column_stack([edges[:-1].T.ravel(), edges[1:].T.ravel()])

    monkeypatch.setattr(conditions, "resolved", fine)
    start = dict(zip(est.names, est.values, strict=True))
    reference = fq.asymptotic_fit(plant, spectrum, factor * T1, hold, TRUE, start=start, n_starts=1)
    assert np.abs(est.values / reference.values - 1).max() < 1e-8


@pytest.fixture(scope="module")
def noise(plant):
    """200 s of low-pass noise to 50 Hz, held at 0.5 ms, and its spectrum."""
    b, a = scipy.signal.butter(2, 0.05)
    u = scipy.signal.lfilter(b, a, fq.white_noise(402000, seed=5))[2000:]
    return fq.FilteredSpectrum((b, a)), fq.simulate(plant, u, T1)


@pytest.mark.study
@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("factor", [5, 10, 20])
def test_against_time_domain_fits_of_long_noise(plant, noise, factor, hold):
    """Aliasing included: both ends started alike, where two minima are nearly as good."""
    spectrum, record = noise
    dt = factor * T1
    expected = fq.asymptotic_fit(plant, spectrum, dt, hold, TRUE, duration=200)
    start = dict(zip(expected.names, expected.values, strict=True))
    slow = record.decimate(factor)
    est = fq.fit(plant, slow, hold=hold, domain="time", start=start, n_starts=1)
    std = expected.parameters["std"].to_numpy()
    assert (np.abs(est.values - expected.values) < 3 * std).all()
    if factor == 20:
        # the scatter is small beside the bias, so that this says something
        away = np.abs(expected.values - [plant[n] for n in est.names]) / std
        assert away.max() > 5


def test_the_apparent_response_of_long_noise(plant, noise):
    spectrum, record = noise
    slow = record.decimate(20)
    f, Puy = scipy.signal.csd(slow.u, slow.y, fs=100, nperseg=500)
    _, Puu = scipy.signal.welch(slow.u, fs=100, nperseg=500)
    _, gamma = scipy.signal.coherence(slow.u, slow.y, fs=100, nperseg=500)
    band = (f > 28) & (f < 48)
    seen = fq.apparent_response(plant, spectrum, 20 * T1, TRUE, frequency=f[band])
    G = (Puy / Puu)[band]
    assert np.abs(seen.response[0, 0] - G).mean() < 0.15 * np.abs(G).mean()
    # eighty segments leave each estimate of the coherence a tenth
    lost = seen.coherence[0, 0] - gamma[band]
    assert np.abs(lost).mean() < 0.1
    assert abs(lost.mean()) < 0.02
    assert seen.coherence[0, 0, -1] < 0.8


def test_the_antialias_filter_restores_the_coherence(plant):
    bare = fq.apparent_response(plant, fq.WhiteSpectrum(), 10e-3, TRUE)
    filtered = fq.apparent_response(plant, fq.WhiteSpectrum(), 10e-3, TRUE, antialias=True)
    below = filtered.frequency < 30
    assert bare.coherence[..., below].min() < 0.7
    assert filtered.coherence[..., below].min() > 0.999
    true = plant.frequency_response(filtered.omega[below], TRUE).response
    assert np.allclose(filtered.response[..., below], true, rtol=1e-2)


def test_lines_fold_with_their_phase():
    """A line above the slow Nyquist limit is seen mirrored, with the conjugate response."""
    plant = fq.first_order()
    seen = fq.apparent_response(plant, fq.LineSpectrum([180.0], [1.0]), 5e-3, TRUE)
    assert seen.frequency[0] == pytest.approx(20)
    there = plant.frequency_response([2 * np.pi * 180], TRUE).response[0, 0, 0]
    assert seen.response[0, 0, 0] == pytest.approx(there.conj())
    record = fq.simulate(plant, fq.sine(180, 2, T1), T1).decimate(10).slice(1, 2)
    k = 20
    ratio = np.fft.fft(record.y)[k] / np.fft.fft(record.u)[k]
    assert ratio == pytest.approx(there.conj(), rel=1e-9)


@pytest.mark.study
def test_a_prefilter_moves_the_estimate_as_the_spectrum_would(plant):
    low_pass = control.tf([1], [1 / (2 * np.pi * 30), 1])
    weighted = fq.asymptotic_fit(
        plant, fq.ChirpSpectrum(10, 80), 5e-3, "zoh", TRUE, prefilter=low_pass
    )
    shaped = fq.FilteredSpectrum(low_pass, fq.ChirpSpectrum(10, 80))
    other = fq.asymptotic_fit(plant, shaped, 5e-3, "zoh", TRUE)
    inverse = fq.asymptotic_fit(
        plant, fq.ChirpSpectrum(10, 80), 5e-3, "zoh", TRUE,
        noise_model=lambda omega: 1 + 1j * omega / (2 * np.pi * 30),
    )  # fmt: skip
    plain = fq.asymptotic_fit(plant, fq.ChirpSpectrum(10, 80), 5e-3, "zoh", TRUE)
    assert np.allclose(weighted.values, other.values, rtol=1e-8)
    assert np.allclose(weighted.values, inverse.values, rtol=1e-8)
    assert abs(weighted["d"] / plain["d"] - 1) > 0.01


def test_black_boxes(plant):
    """Eq. 15 over a flat spectrum, and the exact poles under the remembered hold."""
    chirp = fq.ChirpSpectrum(10, 80)
    est = fq.asymptotic_fit(plant, chirp, 5e-3, "zoh", TRUE, model=fq.OutputError(3))
    b = fq.paper.numerator(est)
    assert np.allclose(b, [1.05e3, -6.8e3, 1.278e7], rtol=0.02)
    exact = fq.asymptotic_fit(plant, chirp, 5e-3, None, TRUE, model=fq.TransferFunction(2, 3))
    found = np.sort_complex(exact.to_control().poles())
    assert np.allclose(found, np.sort_complex(plant.to_control().poles()), rtol=1e-7)


@pytest.mark.study
def test_standard_errors_match_the_scatter(plant):
    """Deterministic input, white noise: 200 fits of 5 s."""
    u = fq.chirp(10, 80, 5, T1)
    clean = fq.simulate(plant, u, T1)
    expected = fq.asymptotic_fit(
        plant, fq.ChirpSpectrum(10, 80), T1, None, TRUE, noise_std=1.0, duration=5
    ).parameters["std"]
    values = [
        fq.fit(plant, clean.with_noise(1.0, seed=s), band=(10, 80)).values for s in range(200)
    ]
    assert np.allclose(np.std(values, axis=0), expected, rtol=0.2)


def test_the_constant_part_says_nothing_of_a_plant_that_integrates():
    """A binary sequence has a line at zero, where the position of a free axis has no response."""
    axis = fq.drivetrain(2, outputs=["motor position"]).with_values(fm=0)
    axis = axis.fix("fm")
    spectrum = fq.PRBSSpectrum(8, clock=4)
    est = fq.asymptotic_fit(axis, spectrum, 2e-3, None, fq.ZeroOrderHold(2e-3))
    assert max(abs(est[n] / axis[n] - 1) for n in est.names) < 1e-6


def test_two_inputs_and_two_outputs(rng):
    A = np.array([[-3.0, 10, 0], [-10, -3, 0], [0, 0, -5]])
    B, C = rng.standard_normal((3, 2)), rng.standard_normal((2, 3))
    model = fq.GreyBox(
        lambda w, a: (A * np.array([[1, w, 1], [w, 1, 1], [1, 1, a]]), B, C, None),
        [fq.Parameter("w", 1.0), fq.Parameter("a", 1.0)],
    )
    est = fq.asymptotic_fit(model, fq.ChirpSpectrum(0.2, 4), 0.1, None, fq.ZeroOrderHold(0.01))
    assert np.allclose(est.values, 1, rtol=1e-9)
    biased = fq.asymptotic_fit(model, fq.ChirpSpectrum(0.2, 4), 0.1, "zoh", fq.ZeroOrderHold(0.01))
    assert np.abs(biased.values - 1).max() > 0.01


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"spectrum": fq.LineSpectrum([30], [1])}, "2 real values for 5"),
        ({"dt": 1.7 * T1}, "whole number"),
        ({"spectrum": fq.ChirpSpectrum(10, 2000)}, "Nyquist"),
        ({"band": (90, 99)}, "no energy between 90 and 99"),
        ({"spectrum": "chirp"}, "not a spectrum"),
        ({"true_hold": "zoh"}, "not a hold"),
        ({"noise_std": -1}, "noise_std"),
        ({"model": "two-mass"}, "not a model"),
    ],
)
def test_bad_input(plant, arguments, match):
    usual = {"spectrum": fq.ChirpSpectrum(10, 80), "dt": 5e-3, "true_hold": TRUE}
    with pytest.raises(ValueError, match=match):
        fq.asymptotic_fit(plant, **{**usual, **arguments})


def test_parameters_that_a_spectrum_does_not_determine_are_named(plant):
    three = fq.LineSpectrum([12, 12.00001, 12.00002], [1, 1, 1])
    est = fq.asymptotic_fit(plant, three, 5e-3, None, TRUE)
    assert any("not identifiable" in w for w in est.warnings)


def test_lines_that_fold_onto_one_another_are_named():
    """A PRBS of 510 samples, every third kept: three fits to long records, by which are kept."""
    plant, dt = fq.first_order().with_values(a=30.0, b=12.0), 4e-3
    held = fq.ZeroOrderHold(dt)
    u = np.tile(fq.prbs(8, dt, clock=2), 20)
    found = []
    for shift in range(3):
        record = fq.simulate(plant, u[shift : shift + 510 * 18], dt).slice(510 * 6 * dt)
        found.append(fq.fit(plant, record.decimate(3), initial_state="steady")["a"])
    assert max(found) > 1.5 * min(found)
    est = fq.asymptotic_fit(plant, fq.PRBSSpectrum(8, 2), 3 * dt, true_hold=held)
    assert "folded lines" in [w.kind for w in est.warnings]
    assert est.verdict.grade == "doubt"
    table = fq.bias_map(plant, {"prbs": fq.PRBSSpectrum(8, 2)}, [3, 7], [None], base_dt=dt)
    told = table.groupby("factor")["message"].first()
    assert "fold onto one another" in told[3]
    # with no divisor in common each line has a place of its own
    assert "fold onto one another" not in told[7]


@pytest.mark.parametrize("spectrum", [fq.ChirpSpectrum(1, 40), fq.MultisineSpectrum((1, 40), 4.1)])
def test_lines_apart_and_densities_are_not(spectrum):
    plant, dt = fq.first_order().with_values(a=30.0, b=12.0), 4e-3
    est = fq.asymptotic_fit(plant, spectrum, 4 * dt, true_hold=fq.ZeroOrderHold(dt))
    assert "folded lines" not in [w.kind for w in est.warnings]


@pytest.mark.parametrize(
    ("model", "words"),
    [(None, "a=189.48 where the plant has 100"), (fq.TransferFunction(0, 1), "off by 32.")],
)
def test_what_is_known_to_be_biased_is_not_trusted(model, words):
    """A pole 89 % off had been trusted, its interval of no width."""
    plant, spectrum = fq.first_order(), fq.ChirpSpectrum(10, 80)
    wrong = fq.asymptotic_fit(plant, spectrum, 5e-3, "zoh", TRUE, model=model)
    assert wrong.verdict.grade == "doubt"
    assert [w for w in wrong.warnings if w.kind == "biased" and words in w], wrong.warnings
    right = fq.asymptotic_fit(plant, spectrum, 5e-3, None, TRUE, model=model)
    assert right.verdict.grade == "trust"
    assert not right.warnings


def test_a_bias_inside_of_the_error_bars_is_no_doubt():
    """A first-order hold at factor two makes the pole 7 % less; the bar of one second is 6 %."""
    plant, spectrum = fq.first_order(), fq.ChirpSpectrum(10, 80)
    for duration, severity in ((1.0, "minor"), (1e7, "serious")):
        est = fq.asymptotic_fit(
            plant, spectrum, 1e-3, "foh", TRUE, noise_std=0.3, duration=duration
        )
        (found,) = (w for w in est.warnings if w.kind == "biased")
        assert "-6.79 %" in found
        assert found.severity == severity


def test_a_hold_that_runs_out_of_reach_is_named_in_the_estimate(plant):
    est = fq.asymptotic_fit(
        plant, fq.ChirpSpectrum(10, 80), 5e-3, "estimate", fq.FirstOrderHold(T1)
    )
    assert est.verdict.grade == "do not use"
    assert "no hold" in [w.kind for w in est.warnings]


@pytest.mark.parametrize(("cutoff", "factor"), [(0.2, 1), (0.35, 4), (0.4, 1)])
def test_two_lags_that_are_one_do_not_run_away(cutoff, factor):
    """Values of ±1e5 had stood beside the cost of two equal tanks, as converged."""
    tanks = fq.GreyBox(
        lambda a1, a2, c: ([[-a1 - c, c], [c, -a2 - c]], [[1], [0]], [[0, 1.0]], None),
        [fq.Parameter("a1", 0.8), fq.Parameter("a2", 0.5), fq.Parameter("c", 0.3)],
    )
    est = fq.asymptotic_fit(
        tanks, fq.FilteredSpectrum(scipy.signal.butter(2, cutoff)), dt=0.05 * factor, hold="bl",
        true_hold=fq.ZeroOrderHold(0.05), antialias=factor > 1,
    )  # fmt: skip
    assert est["a1"] == pytest.approx(est["a2"], rel=1e-2)
    assert 0.3 < est["a1"] < 1.0
    assert 0.2 < est["c"] < 0.4
