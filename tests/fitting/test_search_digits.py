"""How many digits the matrices of a search have: on its way those of doubles, at its end all."""

import numpy as np
import pytest
import scipy

import freqid as fq
from freqid.lti.holds import hold as holds


def test_what_a_search_meets_on_its_way_is_no_reason_for_twice_the_digits(monkeypatch):
    """Scattered starts of a slow output ran to rates of 1e13 rad/s, at 200 ms a trial point: a fit
    of three parameters took 38 s.
    """
    counted = []
    whole = holds.doubled_exponential
    monkeypatch.setattr(holds, "doubled_exponential", lambda X: counted.append(1) or whole(X))

    def actuator(K, w, z):
        return (
            [[0, 1, 0], [0, 0, 1], [0, -(w**2), -2 * z * w]],
            [[0], [0], [K * w**2]],
            [[1, 0, 0]],
            None,
        )

    true = {"K": 0.3, "w": 90.0, "z": 0.2}
    model = fq.GreyBox(actuator, [fq.Parameter(n, v) for n, v in true.items()])
    u = 0.1 + fq.chirp(0.5, 30, 6, 1e-3)
    record = fq.simulate(model, u, 1e-3).with_noise(1e-3, seed=0).decimate(10, keep_input=True)
    est = fq.fit(model, record, start={"K": 0.1, "w": 150.0, "z": 0.6})
    assert est.values == pytest.approx(list(true.values()), rel=0.03)
    assert len(counted) < 30


def test_a_plant_that_needs_twice_the_digits_has_them_at_the_end():
    """Rates nine decades apart, found by scattered starts: the cost is that of exact matrices."""

    def lags(a, b, g):
        return [[-a, 0], [0, -b]], [[a], [b]], [[1.0, g]], None

    model = fq.GreyBox(
        lags, [fq.Parameter("a", 2.0), fq.Parameter("b", 2e9), fq.Parameter("g", 0.5)]
    )
    record = fq.simulate(model, fq.white_noise(800, seed=1), 0.05)
    est = fq.fit(model.fix("b"), record, start={"a": 5.0, "g": -0.2}, n_starts=14)
    assert [est["a"], est["g"]] == pytest.approx([2.0, 0.5], rel=1e-9)


@pytest.mark.study
@pytest.mark.parametrize(("n", "seed"), [(1500, 19), (3000, 33), (3000, 38)])
def test_a_step_too_short_to_gain_gains_nothing(n, seed):
    """A lag of -5 µs: steps of 1e-8 along derivatives that rounding had made were to gain half of
    the cost, which nobody looked at. What ended there cost three times what the start did.
    """

    def drive(J, b, tau):
        return [[-1 / tau, 0], [1 / J, -b / J]], [[1 / tau, 0], [0, 1 / J]], [[0, 1]], None

    def model_of(inputs):
        def matrices(J, b, tau):
            A, B, C, D = drive(J, b, tau)
            return A, [row[:inputs] for row in B], C, D

        true = {"J": 0.01, "b": 0.05, "tau": 4e-3}
        return fq.GreyBox(matrices, [fq.Parameter(n, v) for n, v in true.items()])

    rng = np.random.default_rng(seed)
    u = 3 * np.repeat(rng.normal(size=n // 100), 100)
    torque = 0.13 * scipy.signal.lfilter([1], [1, -0.9], rng.normal(size=n))
    y = fq.simulate(model_of(2), np.column_stack([u, torque]), 1e-3).y[:, 0]
    est = fq.fit(model_of(1), fq.Record(u, y + 0.3 * rng.normal(size=n), 1e-3))
    off = np.abs(est.values - [0.01, 0.05, 4e-3])
    assert (off < 4 * np.sqrt(np.diag(est.covariance_matrix))).all()
