"""How the noise of lines gets into local models, and from there into error bars of a fit."""

import numpy as np
import pytest
import scipy

import freqid as fq

DT = 0.01


def resonance():
    def mode(w, z, g):
        return [[0, 1], [-w * w, -2 * z * w]], [[0], [1]], [[g * w * w, 0]], [[0]]

    values = {"w": 40.0, "z": 0.05, "g": 1.0}
    return fq.GreyBox(mode, [fq.Parameter(n, v) for n, v in values.items()])


def noisy(seed, samples=600, level=0.1):
    clean = fq.simulate(resonance(), fq.white_noise(samples, seed=seed), DT)
    return clean, clean.with_noise(level * clean.y.std(), seed=seed + 1000)


@pytest.mark.parametrize("band", [None, (3.0, 11.0)])
def test_rows_carry_the_outputs_noise_into_the_response(band):
    """Local polynomials are linear in the output: the error is the rows times the noise's DFT."""
    clean, record = noisy(1)
    exact, frf = (fq.local_polynomial(r, band=band) for r in (clean, record))
    noise = np.fft.rfft(np.ravel(record.y - clean.y))[1:]
    known = frf.line_noise
    assert not any(a.flags.writeable for a in (known.first, known.rows, known.power))
    # the first of the lines that the windows saw, half a window below the band
    start = 0 if band is None else np.searchsorted(np.arange(1, 300) / 6.0, 3.0) - known.first[0]
    start -= 0 if band is None else known.rows.shape[-1] // 2
    seen = known.first[:, None] + np.arange(known.rows.shape[-1]) + max(start, 0)
    error = np.sum(known.rows[:, 0, 0, 0] * noise[seen], axis=1)
    assert np.allclose(error, frf.response[0, 0] - exact.response[0, 0], atol=1e-12)
    # each window's own noise, or that of the windows around each of its lines
    assert known.variance.mean() == pytest.approx(frf.variance.mean(), rel=0.2)


def test_a_sum_over_lines_has_the_variance_of_dense_algebra():
    known = fq.local_rational(noisy(2)[1], band=(4.0, 9.0)).line_noise
    K, n = len(known.first), known.power.shape[1]
    dense = np.zeros((K, n), complex)
    for k, (first, row) in enumerate(zip(known.first, known.rows[:, 0, 0, 0], strict=True)):
        dense[k, first : first + len(row)] = row
    covariance = dense * known.power[0] @ dense.conj().T
    at = np.random.default_rng(0).standard_normal((3, K, 2)) @ [1, 1j]
    direct = (at.conj() @ covariance @ at.T).real / 2
    assert np.allclose(known.along(at[:, None, None]), direct, rtol=1e-10)


def test_lines_that_are_left_keep_their_noise():
    frf = fq.local_rational(noisy(3)[1])
    part, asked = frf.select((4.9, 8.1)), frf.with_conditions(q=1.0).select((4.9, 8.1))
    at = (frf.frequency > 4.9) & (frf.frequency < 8.1)
    assert np.array_equal(part.line_noise.variance, frf.line_noise.variance[..., at])
    assert asked.conditions == {"q": 1.0}
    assert np.array_equal(asked.line_noise.rows, part.line_noise.rows)


@pytest.mark.study
@pytest.mark.parametrize("estimate", [fq.local_rational, fq.local_polynomial])
def test_error_bars_of_a_resonance_that_four_lines_tell(estimate):
    """40 records of six seconds: 95 % intervals hold; they held in 91 %."""
    model, held, size = resonance(), [], []
    for seed in range(40):
        est = fq.fit(model, estimate(noisy(seed)[1]), weights="noise")
        table, truth = est.parameters, [model[n] for n in est.parameters.index]
        held.append((table["lower"] <= truth) & (truth <= table["upper"]))
        size.append((table["value"] - truth) / table["std"])
    assert 0.92 <= np.mean(held) <= 1
    assert 0.7 < np.sqrt(np.mean(np.square(size))) < 1.25


@pytest.mark.study
def test_a_sharp_resonance_keeps_its_height_in_noise():
    """Equations with noisy outputs in them flatten it: 1.4 % of damping on average of these 40."""
    model, found = resonance(), []
    for seed in range(40):
        frf = fq.local_rational(noisy(seed, level=0.2)[1])
        found.append(fq.fit(model, frf, weights="noise")["z"] / 0.05 - 1)
    assert abs(np.mean(found)) < 3 * np.std(found) / np.sqrt(len(found))


def test_windows_next_to_weak_input_reach_what_is_least():
    """A belt servo's chirp from 1 Hz: two steps left lines 0.8 % off, with bars of 0.3 %."""
    Jm, Jl, k, c, b = 1.2e-4, 6e-4, 4.0, 2e-3, 1e-3
    A = [[-(b + c) / Jm, c / Jm, -k / Jm], [c / Jl, -c / Jl, k / Jl], [1, -1, 0]]
    plant = scipy.signal.StateSpace(A, [[1 / Jm], [0], [0]], [[1, 0, 0]], [[0]]).to_discrete(1e-3)
    t, error, told = np.arange(8000) * 1e-3, [], []
    u = 0.3 * np.sin(2 * np.pi * (t + 119 * t * t / 16))
    clean = scipy.signal.dlsim(plant, u)[1][:, 0]
    for seed in range(1000, 1016):
        noise = 0.05 * np.random.default_rng(seed).standard_normal(8000)
        frf = fq.local_rational(fq.Record(u, clean + noise, 1e-3), band=(1, 120))
        part = (frf.frequency >= 5) & (frf.frequency < 8)
        z = np.exp(2e-3j * np.pi * frf.frequency[part])[:, None, None]
        true = (plant.C @ np.linalg.solve(z * np.eye(3) - plant.A, plant.B))[:, 0, 0]
        error.append(np.abs(frf.response[0, 0, part] / true - 1) ** 2)
        told.append(frf.variance[0, 0, part] / np.abs(true) ** 2)
    assert np.mean(error) < 4e-5
    assert np.mean(np.divide(error, told)) < 5


@pytest.mark.parametrize("kind", ["csv", "parquet", "xlsx", "frame"])
def test_tables_keep_what_lines_share(kind, tmp_path):
    """Error bars of a response that was written and read are those that it had."""
    frf = fq.local_rational(noisy(4)[1], band=(2.0, 20.0))
    frame, path = frf.to_frame(), tmp_path / f"frf.{kind}"
    if kind == "csv":
        frame.to_csv(path, index=False)
    elif kind == "parquet":
        frame.to_parquet(path)
    elif kind == "xlsx":
        frame.to_excel(path, index=False)
    again = fq.FrequencyResponse.from_frame(frame) if kind == "frame" else fq.read_response(path)
    fits = [fq.fit(resonance(), data, weights="noise") for data in (frf, again)]
    std = [np.sqrt(np.diag(est.covariance_matrix)) for est in fits]
    np.testing.assert_allclose(std[1], std[0], rtol=2e-3)
    assert fits[0].verdict.grade == fits[1].verdict.grade
    one, two = (data.select((4.0, 9.0)).line_noise for data in (frf, again))
    at = np.random.default_rng(0).standard_normal((2, 1, 1, len(one.first), 2)) @ [1, 1j]
    np.testing.assert_allclose(two.along(at), one.along(at), rtol=1e-2)


def test_tables_of_several_channels_and_experiments_keep_it(tmp_path):
    """Two inputs share the noise of an output; columns and rows may be some of them."""
    rng, records = np.random.default_rng(0), []
    for _ in range(2):
        u, noise = rng.standard_normal((800, 2)), 0.3 * rng.standard_normal((800, 2))
        y = np.cumsum(u @ [[0.3, 0.1], [-0.2, 0.4]], axis=0)
        y = y - 0.2 * np.concatenate([[[0, 0]], y[:-1]])
        records.append(fq.Record(u, y + noise, DT))
    frf = fq.local_polynomial(records, band=(2.0, 30.0))
    frf.to_frame().to_csv(tmp_path / "frf.csv", index=False)
    again = fq.read_response(tmp_path / "frf.csv")
    assert again.line_noise.rows.shape == frf.line_noise.rows.shape
    at = rng.standard_normal((3, 2, 2, len(frf.frequency), 2)) @ [1, 1j]
    np.testing.assert_allclose(again.line_noise.along(at), frf.line_noise.along(at), rtol=1e-2)
    some = fq.read_response(tmp_path / "frf.csv", input="u2", output="y1")
    np.testing.assert_allclose(
        some.line_noise.along(at[:, :1, 1:]), frf.line_noise.of([0], [1]).along(at[:, :1, 1:]),
        rtol=1e-2,
    )  # fmt: skip


def test_a_damaged_column_is_named():
    frame = fq.local_polynomial(noisy(5)[1]).to_frame()
    frame.loc[3, "line noise"] = "zz"
    with pytest.raises(ValueError, match="'line noise' is damaged"):
        fq.FrequencyResponse.from_frame(frame)
