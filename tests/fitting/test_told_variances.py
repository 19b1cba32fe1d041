"""Responses that tell the variance of their lines: few of them may tell a resonance."""

import dataclasses

import numpy as np
import pytest
import scipy

import freqid as fq
from freqid.fitting.noise_models import ResponseNoise

W, Z, GAIN = 94.0, 0.03, 2.0


def resonance(w, z, g):
    return [[0, 1], [-w * w, -2 * z * w]], [[0], [1]], [[g * w * w, 0]], [[0]]


def begun(off=1.1):
    values = {"w": W, "z": Z, "g": GAIN}
    return fq.GreyBox(resonance, [fq.Parameter(n, v * off) for n, v in values.items()])


def exact(f, w=W, z=Z, g=GAIN):
    s = 2j * np.pi * f
    return g * w**2 / (s**2 + 2 * z * w * s + w**2)


def measured(f, seed, share=0.03, told=1.0):
    """Errors that are a share of the response; ``told`` is what the variance is said to be."""
    rng, G = np.random.default_rng(seed), exact(f)
    unit = rng.standard_normal((2, len(f))).T @ [1, 1j] / np.sqrt(2)
    size = share * np.abs(G)
    return fq.FrequencyResponse(f, G + size * unit, variance=told * size**2)


def scatter(f, share=0.03):
    """Standard errors of unweighted least squares, to first order: H⁻¹ JᵀVJ H⁻¹."""
    values, columns = {"w": W, "z": Z, "g": GAIN}, []
    for name, value in values.items():
        up, down = (exact(f, **{name: value * (1 + d)}) for d in (1e-6, -1e-6))
        columns.append((up - down) / (2e-6 * value))
    J = np.concatenate([np.real(columns), np.imag(columns)], axis=1)
    V = np.tile((share * np.abs(exact(f))) ** 2 / 2, 2)
    inverse = np.linalg.inv(J @ J.T)
    return np.sqrt(np.diag(inverse @ (J * V) @ J.T @ inverse))


@pytest.mark.parametrize("lines", [40, 120])
def test_error_bars_are_those_that_the_variance_makes(lines):
    """Of 40 lines two make the peak: bars from what they left were 0.02 to 0.15 of the truth, and
    29 of 60 fits trusted 5 to 40 of them off."""
    f, off = np.geomspace(0.5, 100, lines), []
    for seed in range(12):
        est = fq.fit(begun(), measured(f, seed))
        std = est.parameters["std"].to_numpy()
        assert std == pytest.approx(scatter(f), rel=0.15)
        off.append((est.values - [W, Z, GAIN]) / std)
    assert 0.7 < np.sqrt(np.mean(np.square(off))) < 1.3


@pytest.mark.study
@pytest.mark.parametrize("lines", [40, 150])
def test_a_line_that_a_parameter_has_to_itself_leaves_no_sign_of_its_noise(lines):
    """Without a variance, noise alike at all lines: z had an rms of 2.75 on 40 of them."""
    f, off = np.geomspace(0.5, 100, lines), []
    for seed in range(30):
        rng, G = np.random.default_rng(seed), exact(f)
        unit = rng.standard_normal((2, lines)).T @ [1, 1j] / np.sqrt(2)
        est = fq.fit(begun(), fq.FrequencyResponse(f, G + 0.1 * unit))
        off.append((est.values - [W, Z, GAIN]) / est.parameters["std"].to_numpy())
    rms = np.sqrt(np.mean(np.square(off), axis=0))
    assert ((rms > 0.6) & (rms < 1.4)).all(), rms


@pytest.mark.parametrize("options", [{}, {"weights": "noise"}, {"error": "log"}])
def test_a_variance_that_is_of_the_wrong_size_is_set_right_by_what_is_left(options):
    """A hundred times too small, or too large, at all lines alike."""
    f = np.geomspace(0.5, 100, 300)
    own = fq.fit(begun(), measured(f, 3), **options).parameters["std"]
    for told in (0.01, 100.0):
        other = fq.fit(begun(), measured(f, 3, told=told), **options).parameters["std"]
        assert other.to_numpy() == pytest.approx(own.to_numpy(), rel=0.35)


@pytest.mark.study
@pytest.mark.parametrize("averages", [3, 5])
def test_variances_of_few_averages_blame_no_model(averages):
    """Lines at which they happen to be small counted for most: 17 of 24 good fits were doubted
    with three averages ("another mode").
    """
    f, doubted, off = np.linspace(1, 60, 250), 0, []
    for seed in range(12):
        rng, G = np.random.default_rng(seed), exact(f)
        unit = rng.standard_normal((averages, 2, len(f))).swapaxes(1, 2) @ [1, 1j] / np.sqrt(2)
        each = G + 0.1 * np.abs(G).mean() * unit
        # the scatter of the mean, as it is found of so many
        told = each.var(axis=0, ddof=1) / averages
        est = fq.fit(
            begun(), fq.FrequencyResponse(f, each.mean(axis=0), variance=told), weights="noise"
        )
        doubted += est.verdict.grade != "trust"
        off.append((est.values - [W, Z, GAIN]) / est.parameters["std"].to_numpy())
    assert doubted <= 1
    assert 0.7 < np.sqrt(np.mean(np.square(off))) < 1.4


def test_a_line_with_a_noise_of_its_own_keeps_it():
    """As the mains hum makes it: neighbours do not tell."""
    f, rng = np.linspace(1, 60, 250), np.random.default_rng(1)
    variance = 1e-4 * rng.chisquare(6, len(f)) / 6
    variance[100] = 1.0
    weights = ResponseNoise().weights(fq.FrequencyResponse(f, exact(f), variance=variance), (250,))
    assert weights[0, 0, 100] == 1.0
    others = np.delete(weights[0, 0], 100)
    assert others.max() < 3 * others.min()
    # of many averages each counts as it is
    same = fq.FrequencyResponse(f, exact(f), variance=1e-4 * np.exp(0.1 * np.sin(f)))
    np.testing.assert_array_equal(ResponseNoise().weights(same, (250,)), 1 / same.variance)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("options", [{"weights": "noise"}, {"error": "log"}])
def test_lines_that_tell_nothing(options):
    f, rng = np.linspace(1, 60, 120), np.random.default_rng(2)
    variance = 1e-4 * rng.chisquare(6, len(f)) / 6
    variance[40:45] = np.inf
    est = fq.fit(begun(), fq.FrequencyResponse(f, exact(f), variance=variance), **options)
    assert est.values == pytest.approx([W, Z, GAIN], rel=1e-6)
    assert np.isfinite(est.parameters["std"]).all()


def test_variances_of_zero_are_no_weights(rng):
    """Records that are alike to the last digit: 1/0 in weights and in the verdict's comparisons."""
    u = rng.standard_normal(2000)
    y = scipy.signal.lfilter([0.1, 0.05], [1, -1.6, 0.8], u) + 0.05 * rng.standard_normal(2000)
    record = fq.Record(u, y, 1e-3)
    twice = fq.etfe([record, record])
    assert (twice.variance == 0).any()
    alone = dataclasses.replace(twice, variance=None)
    for spec in (fq.OutputError(2), fq.TransferFunction(1, 2)):
        est, expected = fq.fit(spec, twice), fq.fit(spec, alone)
        np.testing.assert_allclose(est.values, expected.values, rtol=1e-6)
        assert est.verdict.grade == expected.verdict.grade
        with pytest.raises(ValueError, match=r"variance is 0 at \d+ of 1000 values"):
            fq.fit(spec, twice, weights="noise")


@pytest.mark.parametrize("spec", [None, fq.OutputError(2)])
@pytest.mark.parametrize(
    ("pole", "seeds"),
    [(0.95, 4), *(pytest.param(p, 40, marks=pytest.mark.study) for p in (0.95, -0.8))],
)
def test_coloured_noise_on_an_empirical_response_is_no_mode(pole, seeds, spec):
    """The ratio Y/U of a chirp tells no variance: all right fits had been told "another mode"."""
    plant, dt, n = begun(1.0), 2e-3, 3000
    u = np.concatenate([fq.chirp(1, 80, (n - 500) * dt, dt), np.zeros(500)])
    clean = fq.simulate(plant, u, dt)

    def judged(model, more, seed):
        e = np.random.default_rng(seed).standard_normal(n + 500)
        e = scipy.signal.lfilter([1], [1, -pole], e)[500:]
        y = clean.y + more + 0.1 * clean.y.std() / e.std() * e
        return fq.fit(model, fq.etfe(fq.Record(u, y, dt), band=(1, 80)))

    right = [judged(spec or plant, 0, seed) for seed in range(seeds)]
    assert sum(est.verdict.grade != "trust" for est in right) <= 0.1 * seeds
    assert sum("another mode" in [w.kind for w in est.warnings] for est in right) <= 0.1 * seeds
    mode = fq.simulate(plant.with_values(w=260.0, z=0.02, g=0.06), u, dt).y
    lacking = judged(spec or plant, mode, 0)
    assert "another mode" in [w.kind for w in lacking.warnings]
