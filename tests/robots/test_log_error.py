"""The weighted logarithmic estimator."""

import numpy as np
import pytest

import freqid as fq

F = np.linspace(4, 60, 120)


def measured(plant, seed, size, variance=False):
    """A response with an error that grows with its size."""
    G = plant.frequency_response(2 * np.pi * F).response
    e = np.random.default_rng(seed).standard_normal((2, *G.shape)) / np.sqrt(2)
    told = {"variance": size**2 * np.abs(G) ** 2} if variance else {}
    return fq.FrequencyResponse(F, G * (1 + size * (e[0] + 1j * e[1])), **told)


def test_it_is_exact_without_noise(plant):
    start = {"k": plant["k"] * 1.3, "Jm": plant["Jm"] * 0.8}
    est = fq.fit(plant, measured(plant, 0, 0.0), error="log", start=start)
    assert est.values == pytest.approx([plant[n] for n in est.names], rel=1e-7)


@pytest.mark.study
def test_it_is_better_than_linear_where_errors_grow_with_the_response(plant):
    errors = {"linear": [], "log": []}
    inside = []
    for seed in range(25):
        frf = measured(plant, seed, 0.2)
        for kind in errors:
            est = fq.fit(plant, frf, error=kind)
            errors[kind].append([est[n] / plant[n] - 1 for n in ("Jm", "k", "Ja")])
        table = est.parameters
        inside += [table.lower[n] <= plant[n] <= table.upper[n] for n in ("Jm", "k", "Ja")]
    rms = {kind: np.sqrt(np.mean(np.square(e), axis=0)) for kind, e in errors.items()}
    assert (rms["log"] < 0.7 * rms["linear"]).all()
    # 75 intervals, three of an experiment together
    assert np.mean(inside) > 0.85


def test_its_witness_and_call(plant):
    est = fq.fit(plant, measured(plant, 3, 0.05, variance=True), error="log")
    assert est.witness.verdict in ("complete", "absent")
    assert "error='log'" in est.call
    assert fq.fit(fq.first_order(), measured(plant, 3, 0.05), error="log").verdict.grade != "trust"


def test_what_it_cannot_take(plant, slow):
    with pytest.raises(ValueError, match="responses"):
        fq.fit(plant, slow, error="log")
    with pytest.raises(ValueError, match="error='logarithm'"):
        fq.fit(plant, slow, error="logarithm")
    with pytest.raises(ValueError, match="zero at a line"):
        fq.fit(plant, fq.FrequencyResponse([1.0, 2.0, 3.0, 4.0, 5.0], [1, 0, 1, 1, 1]), error="log")


def test_weights_of_logarithms_shift_no_gain():
    """Weighed by the measured response lines that noise made larger would count for more."""

    def mode(w, z, g):
        return [[0, 1], [-(w**2), -2 * z * w]], [[0], [g * w**2]], [[1, 0]], None

    plant = fq.GreyBox(mode, [fq.Parameter(n, v) for n, v in (("w", 40), ("z", 0.2), ("g", 1))])
    f, rng, pulls = np.linspace(1, 20, 600), np.random.default_rng(1), []
    G = plant.frequency_response(2 * np.pi * f).response[0, 0]
    for _ in range(12):
        noise = rng.standard_normal((2, 600)) / np.sqrt(2)
        measured = G * (1 + 0.1 * (noise[0] + 1j * noise[1]))
        frf = fq.FrequencyResponse(f, measured, variance=(0.1 * np.abs(G)) ** 2)
        est = fq.fit(plant, frf, error="log")
        pulls.append((est["g"] - 1) / est.parameters["std"]["g"])
    assert abs(np.mean(pulls)) < 4 / np.sqrt(12)


@pytest.mark.study
@pytest.mark.parametrize("estimator", [fq.local_rational, fq.local_polynomial])
def test_error_bars_count_that_neighbouring_lines_err_together(estimator):
    """They were 1.5 to 3 times too small, in fits that were trusted."""
    lag, off = fq.first_order(b=50.0, a=20.0), []
    for seed in range(24):
        record = fq.simulate(lag, fq.white_noise(6000, seed=seed), 5e-3)
        frf = estimator(record.with_noise(0.02, seed=seed + 99), band=(1, 90))
        est = fq.fit(lag, frf, error="log")
        off.append([(est[n] - lag[n]) / est.parameters.loc[n, "std"] for n in est.names])
    # 24 runs know a root mean square to about 15 %
    assert (np.sqrt(np.mean(np.square(off), axis=0)) < 1.45).all()


def test_short_segments_are_told_of_logarithms_too():
    """A damping three standard errors off had been trusted in 19 of 20."""
    plant = fq.GreyBox(
        lambda w, z: ([[0, 1], [-w * w, -2 * z * w]], [[0], [1]], [[w * w, 0]], [[0]]),
        [fq.Parameter("w", 40.0), fq.Parameter("z", 0.05)],
    )
    clean = fq.simulate(plant, fq.white_noise(4000, seed=2), 0.01)
    for seed in range(3):
        averaged = fq.h1(clean.with_noise(0.1, seed=seed), segment=500)
        est = fq.fit(plant, averaged, error="log")
        assert est.verdict.grade == "doubt"
        assert "short segments" in [w.kind for w in est.warnings]


def test_lines_that_noise_outweighs_are_no_fault_of_logarithms():
    """Feedthrough had been said 12 times of 12: weights relative to a model shift what is asked
    at lines.
    """
    plant, trusted = fq.two_mass(), 0
    clean = fq.simulate(plant, fq.white_noise(6000, seed=5), 1e-3)
    for seed in range(4):
        noisy = clean.with_noise(0.1 * clean.y.std(), seed=seed)
        est = fq.fit(plant, fq.local_rational(noisy), error="log")
        assert not [w for w in est.warnings if w.kind in ("feedthrough", "hold rejected")]
        trusted += est.verdict.grade == "trust"
    assert trusted >= 3


def test_part_of_an_averaged_response_in_a_file_keeps_what_its_segments_cut_off(tmp_path):
    rng = np.random.default_rng(0)
    u = rng.standard_normal((4000, 2))
    record = fq.Record(u, u @ [1.0, 0.5] + 0.1 * rng.standard_normal(4000), 0.01)
    fq.h1(record, segment=500).to_frame().to_csv(tmp_path / "frf.csv", index=False)
    part = fq.read_response(tmp_path / "frf.csv", input=0)
    assert part.memory is not None
    assert part.memory.shape == (500,)


@pytest.mark.parametrize("variance", [False, True])
def test_weights_that_are_given_stay_what_they_are(plant, variance):
    """Without a variance they had ended in an AssertionError."""
    frf = measured(plant, 0, 0.05, variance)
    some = np.where(F < 30, 1.0, 0.0)
    weighted = fq.fit(plant, frf, error="log", weights=some)
    alone = fq.fit(
        plant,
        measured(plant, 0, 0.05).select((1, 30)),
        error="log",
        weights=np.ones((F < 30).sum()),
    )
    np.testing.assert_allclose(weighted.values, alone.values, rtol=1e-5)
