"""Averages and periods of streams: kept while they grow, and beside scipy and the record."""

import functools

import numpy as np
import pytest
import scipy.signal

import freqid as fq
from freqid.frf import running_sums, segment_sums
from freqid.frf.function_identity import identity_of

N, DT = 30_000, 1e-3
RECORD = fq.simulate(fq.two_mass(), fq.white_noise(N, seed=1), DT).with_noise(0.1)
ROWS = np.column_stack([RECORD.u, RECORD.y])


def test_cross_spectra_are_those_of_scipy():
    rng = np.random.default_rng(0)
    u, noise = rng.standard_normal((N, 2)), rng.standard_normal((N, 2))
    y = scipy.signal.lfilter([1, 0.5], [1, -0.6], u, axis=0) + 0.1 * noise
    record = fq.Record(u, y, DT)
    for data in (record, fq.open(np.column_stack([u, y]), ["a", "b"], ["c", "d"], DT,
                                 columns=["a", "b", "c", "d"], block=1234)):  # fmt: skip
        seen = fq.cross_spectra(data, 1000, band=(5, 400))
        options = {"fs": 1 / DT, "nperseg": 1000, "noverlap": 500, "detrend": "constant"}
        for name, left, right in (("uu", u, u), ("yu", y, u), ("yy", y, y)):
            for i in range(2):
                for j in range(2):
                    # csd(x, y) is E[x* y]
                    f, S = scipy.signal.csd(right[:, j], left[:, i], **options)
                    kept = (f >= 5) & (f <= 400)
                    assert getattr(seen, name)[:, i, j] == pytest.approx(S[kept], rel=1e-9)
        assert seen.frequency == pytest.approx(f[kept])
        assert "2-500" not in repr(seen)
    G = seen.yu @ np.linalg.inv(seen.uu)
    assert np.moveaxis(G, 0, -1) == pytest.approx(fq.h1(record, 1000, band=(5, 400)).response)


@pytest.mark.parametrize("method", [fq.h1, fq.h2, fq.hv, fq.cross_spectra])
def test_an_interrupted_pass_goes_on(tmp_path, method, monkeypatch):
    monkeypatch.setattr(running_sums, "_EVERY", 0.0)
    kept, read = tmp_path / "sums.npz", []

    def blocks(fails):
        for at in range(0, N, 1000):
            if fails and at == 17_000:
                raise OSError("gone")
            read.append(at)
            yield ROWS[at : at + 1000]

    whole = method(fq.open(lambda: blocks(False), dt=DT), 700)
    with pytest.raises(ValueError, match=r"sample 17000: OSError.*sums\.npz.*goes on"):
        method(fq.open(lambda: blocks(True), dt=DT), 700, state=kept)
    again = method(fq.open(lambda: blocks(False), dt=DT), 700, state=kept)
    # a finished state is not worked out again
    calls = []
    monkeypatch.setattr(segment_sums, "_products", lambda *a: calls.append(a))
    third = method(fq.open(lambda: blocks(False), dt=DT), 700, state=kept)
    assert not calls
    for name in ("response", "variance", "uu", "yu", "averages"):
        if hasattr(whole, name):
            assert np.allclose(getattr(again, name), getattr(whole, name), rtol=1e-12)
            assert np.array_equal(getattr(third, name), getattr(again, name))


def test_an_interruption_keeps_the_sums(tmp_path):
    """Ctrl-C in the middle of a pass, of which the pieces before are kept."""
    count, kept = 900_000, tmp_path / "s.npz"
    rows = np.tile(ROWS, (count // N, 1))
    asked = []

    def blocks():
        for at in range(0, count, 100_000):
            asked.append(at)
            if len(asked) == 8:
                raise KeyboardInterrupt
            yield rows[at : at + 100_000]

    stream = fq.open(blocks, dt=DT)
    with pytest.raises(KeyboardInterrupt):
        fq.h1(stream, 1000, state=kept)
    assert 400_000 < int(np.load(kept)["at"]) < 700_000
    again = fq.h1(stream, 1000, state=kept)
    assert np.allclose(again.response, fq.h1(fq.open(rows, dt=DT), 1000).response, rtol=1e-12)


def test_a_log_that_has_grown_costs_what_is_new(tmp_path):
    path, kept = tmp_path / "log.npy", tmp_path / "sums.npz"
    np.save(path, ROWS[:21_000])
    fq.h1(fq.open(path, dt=DT), 500, state=kept)
    seen = int(np.load(kept)["at"])
    assert seen > 20_000
    np.save(path, ROWS)
    grown = fq.h1(fq.open(path, dt=DT), 500, state=kept)
    assert np.allclose(grown.response, fq.h1(RECORD, 500).response, rtol=1e-12)


def test_states_of_something_else_are_refused(tmp_path):
    kept, stream = tmp_path / "sums.npz", fq.open(ROWS, dt=DT)
    fq.h1(stream, 500, state=kept)
    for data, options in (
        (stream, {"segment": 400}),
        (stream, {"segment": 500, "overlap": 0.25}),
        (stream, {"segment": 500, "window": "boxcar"}),
        (stream, {"segment": 500, "detrend": "linear"}),
        (fq.open(ROWS + 1, dt=DT), {"segment": 500}),
        (fq.open(ROWS, dt=2 * DT), {"segment": 500}),
        (stream.slice(1), {"segment": 500}),
    ):
        with pytest.raises(ValueError, match=r"sums\.npz is of another stream"):
            fq.h1(data, state=kept, **options)
    before = kept.read_bytes()
    kept.write_bytes(before[: len(before) // 2])
    with pytest.raises(ValueError, match=r"sums\.npz is no state"):
        fq.h1(stream, 500, state=kept)
    np.save(tmp_path / "data.npz", ROWS)
    with pytest.raises(ValueError, match=r"must end in \.npz"):
        fq.h1(stream, 500, state=tmp_path / "sums.csv")
    with pytest.raises(ValueError, match="in memory"):
        fq.h1(RECORD, 500, state=kept)


@pytest.mark.parametrize("known", [True, False])
def test_a_filter_that_has_seen_the_end_does_not_go_on(tmp_path, known):
    """What follows changes the last samples that it made, which the sums have taken."""
    kept = tmp_path / "sums.npz"

    def seen(count):
        rows = ROWS[:count]
        source = rows if known else lambda: iter(np.array_split(rows, 7))
        return fq.open(source, dt=DT).decimate(5, antialias=True)

    first = fq.h1(seen(21_000), 500, state=kept)
    assert np.array_equal(fq.h1(seen(21_000), 500, state=kept).response, first.response)
    with pytest.raises(ValueError, match=r"sums\.npz is of a stream that had ended"):
        fq.h1(seen(N), 500, state=kept)
    # one that was interrupted goes on: its filter had seen what follows
    other = tmp_path / "other.npz"
    bad = ROWS.copy()
    bad[19_000] = np.nan
    with pytest.raises(ValueError, match=r"other\.npz"):
        fq.h1(fq.open(bad, dt=DT, block=3000).decimate(5, antialias=True), 500, state=other)
    again = fq.h1(fq.open(ROWS, dt=DT).decimate(5, antialias=True), 500, state=other)
    whole = fq.h1(fq.open(ROWS, dt=DT).decimate(5, antialias=True), 500)
    assert np.allclose(again.response, whole.response, rtol=1e-9)


def test_the_samples_before_a_mistake_are_kept(tmp_path):
    bad = ROWS.copy()
    bad[19_000] = np.nan
    with pytest.raises(ValueError, match="sample 19000 is NaN"):
        fq.h1(fq.open(bad, dt=DT), 500, state=tmp_path / "s.npz")
    assert int(np.load(tmp_path / "s.npz")["at"]) == 18_750


def test_a_log_that_has_lost_samples_is_told(tmp_path):
    """Its sums would be of what is no longer there."""
    kept = tmp_path / "sums.npz"
    fq.h1(fq.open(ROWS, dt=DT), 500, state=kept)
    fq.h1(fq.open(ROWS, dt=DT), 500, state=kept)
    with pytest.raises(ValueError, match=r"is of 30000 samples and more.*has 20000"):
        fq.h1(fq.open(ROWS[:20_000], dt=DT), 500, state=kept)


def test_a_state_takes_no_memory_without_bound(tmp_path):
    kept = tmp_path / "sums.npz"
    np.savez_compressed(kept, total_uu=np.zeros(60_000_000))
    with pytest.raises(ValueError, match=r"sums\.npz.*would take"):
        fq.h1(fq.open(ROWS, dt=DT), 500, state=kept)


def test_progress_is_shown(capsys):
    stream = fq.open(ROWS, dt=DT)
    fq.h1(stream, 500, progress=True)
    assert "samples: " in capsys.readouterr().err
    with pytest.raises(ValueError, match="progress"):
        fq.h1(stream, 500, progress="yes")


def test_a_state_tells_functions_apart(tmp_path):
    """Two lambdas have one name: the sums of the one had been given for the other."""
    kept, stream = tmp_path / "sums.npz", fq.open(ROWS, dt=DT)

    def less(part):
        return lambda x: x - part * x.mean(axis=-1, keepdims=True)

    first = fq.h1(stream, 500, detrend=less(1.0), state=kept)
    again = fq.h1(stream, 500, detrend=less(1.0), state=kept)
    assert np.array_equal(first.response, again.response)
    for other in (less(0.5), lambda x: x - x[..., :1], functools.partial(np.multiply, 2.0)):
        with pytest.raises(ValueError, match="is of another stream"):
            fq.h1(stream, 500, detrend=other, state=kept)


def test_what_tells_functions_apart():
    def nested(part):
        return lambda x: (lambda y: part * y)(x)

    def itself(x, again=True):
        return itself(x, False) if again else x

    class Level:
        def __init__(self, size):
            self.size = size

        def off(self, x):
            return x - self.size

    long = [np.arange(2000.0), np.r_[np.arange(1999.0), 0]]
    pairs = [
        (nested(1), nested(2)),
        (nested(long[0]), nested(long[1])),
        (lambda x, *, k=1: k * x, lambda x, *, k=2: k * x),
        (functools.partial(np.multiply, 2), functools.partial(np.multiply, 3)),
    ]
    for one, other in pairs:
        assert identity_of(one) == identity_of(one)
        assert identity_of(one) != identity_of(other)
    assert identity_of(nested(1)) == identity_of(nested(1))
    assert identity_of(itself) == identity_of(itself)
    assert repr(identity_of(Level(1.0).off))
    assert identity_of("linear") == "'linear'"


def test_a_trend_may_be_a_function():
    seen = fq.h1(RECORD, 500, detrend=lambda x: x - x.mean(axis=-1, keepdims=True))
    assert np.allclose(seen.response, fq.h1(RECORD, 500).response)


def periods(seed, count=24, noise=0.05):
    u = fq.multisine((1, 60), 0.5, DT, periods=count, seed=seed)
    return fq.simulate(fq.first_order(), u, DT, hold="bl").with_noise(noise, seed=seed)


@pytest.mark.study
@pytest.mark.parametrize("block", [100, 777, 5000])
@pytest.mark.parametrize("known", [True, False])
def test_periods_of_a_stream_are_those_of_the_record(block, known, monkeypatch):
    monkeypatch.setattr("freqid.frf.means._AT_ONCE", 1500)
    record = periods(1)
    rows = np.column_stack([record.u, record.y])
    source = rows if known else lambda: iter(np.array_split(rows, 37))
    stream = fq.open(source, dt=DT, hold="bl", block=block)
    for options in ({"skip": 2}, {"period": 0.5, "skip": 3, "band": (5, 40)}):
        whole, seen = fq.periodic(record, **options), fq.periodic(stream, **options)
        assert seen.frequency.tolist() == whole.frequency.tolist()
        for name in ("response", "variance", "inputs", "outputs", "noise", "input_spectrum"):
            assert getattr(seen, name) == pytest.approx(getattr(whole, name), rel=1e-7), name
        assert seen.freedom == whole.freedom
        assert (seen.dt, seen.hold) == (whole.dt, whole.hold)
    est = fq.fit(fq.first_order(), seen)
    assert est["a"] == pytest.approx(100, rel=0.02)


def test_experiments_of_several_streams():
    rng = np.random.default_rng(5)
    plant = np.array([[1.0, 0.4], [-0.3, 0.8]])
    records, streams = [], []
    for sign in (1, -1):
        u = fq.multisine((1, 60), 0.5, DT, periods=12, seed=7)
        both = np.column_stack([u, sign * u])
        y = both @ plant.T + 0.01 * rng.standard_normal(both.shape)
        records.append(
            fq.Record(both, y, DT, "bl", input_names=["a", "b"], output_names=["c", "d"])
        )
        streams.append(fq.open(np.hstack([both, y]), ["a", "b"], ["c", "d"], DT, "bl",
                               columns=["a", "b", "c", "d"]))  # fmt: skip
    whole, seen = fq.periodic(records, 0.5), fq.periodic(streams, 0.5)
    assert seen.response == pytest.approx(whole.response, rel=1e-9)
    assert seen.variance == pytest.approx(whole.variance, rel=1e-7)
    with pytest.raises(ValueError, match="must agree"):
        fq.periodic([streams[0], streams[1].select("a", "c")], 0.5)
    with pytest.raises(ValueError, match=r"records\[1\]"):
        fq.periodic([streams[0], records[1]], 0.5)
    with pytest.raises(ValueError, match="reference"):
        fq.periodic(streams, 0.5, reference=True)
    with pytest.raises(ValueError, match="hold 1 periods"):
        fq.periodic(streams[0].select("a").slice(stop=0.6), 0.5)


def test_an_iterator_that_can_be_read_once_keeps_no_state(tmp_path):
    """What is said of it says why."""
    stream = fq.open(iter([np.ones((2000, 2))]), "u", "y", dt=1e-3)
    with pytest.raises(ValueError, match="state= looks at its beginning first"):
        fq.h1(stream, 500, state=tmp_path / "a.npz")
