"""Local models behind a reference: noise of inputs and outputs goes together in a loop."""

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

import freqid as fq

DT, TRUE = 2e-3, {"J": 0.01, "k": 40.0, "Ja": 0.008, "f": 0.02, "d": 0.005}


def two_masses(J, k, Ja, f, d):
    A = [[0, 1, -1], [-k / J, -(f + d) / J, d / J], [k / Ja, d / Ja, -d / Ja]]
    return A, [[0], [1 / J], [0]], [[0, 1.0, 0]], [[0]]


MODEL = fq.GreyBox(two_masses, [fq.Parameter(n, v) for n, v in TRUE.items()])


def in_a_loop(seed, part, n=4000, settle=500, Kp=0.1, Ki=1.0, r=None):
    """Two masses under a speed loop whose torque is disturbed by a ``part`` of its own size."""
    rng = np.random.default_rng(seed)
    A, B, C = (np.array(M) for M in two_masses(*TRUE.values())[:3])
    step = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 4))]]) * DT)
    F, G = step[:3, :3], step[:3, 3:]
    # states, and the integral of the controller; inputs are reference and disturbance
    closed = np.block([[F - (Kp + Ki * DT) * G @ C, G], [-Ki * DT * C, np.ones((1, 1))]])
    enters = np.block([[(Kp + Ki * DT) * G, G], [np.full((1, 1), Ki * DT), np.zeros((1, 1))]])
    sees = np.block([[C, 0 * C[:, :1]], [-(Kp + Ki * DT) * C, np.ones((1, 1))]])
    through = np.array([[0, 0], [Kp + Ki * DT, 0]])
    if r is None:
        r = np.repeat(rng.standard_normal((n + settle) // 2), 2)
    w = rng.standard_normal(n + settle)

    def run(*signals):
        system = scipy.signal.dlti(closed, enters, sees, through, dt=1)
        return scipy.signal.dlsim(system, np.stack(signals, axis=1))[1][settle:]

    y, u = run(r, part * run(r, 0 * w)[:, 1].std() * w).T
    return fq.Record(u, y, DT, reference=r[settle:])


def response_at(omega):
    A, B, C = (np.array(M) for M in two_masses(*TRUE.values())[:3])
    step = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 4))]]) * DT)
    z = np.exp(1j * omega * DT)[:, None, None]
    return (C @ np.linalg.solve(z * np.eye(3) - step[:3, :3], step[:3, 3:]))[:, 0, 0]


@pytest.mark.study
@pytest.mark.parametrize("part", [0.15, 0.7])
@pytest.mark.parametrize("estimate", [fq.local_polynomial, fq.local_rational])
def test_error_bars_of_a_light_resonance_in_a_loop(estimate, part):
    """The worst parameter was 1.8 to 2.2 bars off (rms): noise of both was taken for unrelated."""
    size = []
    for seed in range(8):
        frf = estimate(in_a_loop(seed, part), band=(2, 200), reference=True)
        table = fq.fit(MODEL, frf, start={n: 1.2 * v for n, v in TRUE.items()}).parameters
        size.append((table["value"] - list(TRUE.values())) / table["std"])
    rms = np.sqrt(np.mean(np.square(size), axis=0))
    assert rms.max() < 1.5
    assert np.abs(size).max() < 4
    assert rms.min() > 0.2


def test_lines_that_the_loops_own_noise_drives_are_not_believed():
    """With as much noise as reference G goes to −1/K at some lines, where first orders see none."""
    record = in_a_loop(3, 1.5)
    frf = fq.local_rational(record, band=(2, 200), reference=True)
    size = np.abs(frf.response[0, 0] - response_at(frf.omega)) ** 2 / frf.variance[0, 0]
    # sixteen or so lines of freedom: F(2, 16) above 9 is one of 400
    assert np.mean(size < 9) > 0.98
    assert np.median(size) > 0.1


def test_lines_that_no_reference_drives_are_left_out():
    """Beyond a multisine's last line nothing but noise went round: 60 of 1,591 lines were some 1e8
    variances off, and a fit to them took 20 s.
    """
    once = fq.multisine((2, 60), 4000 * DT, DT, seed=2)
    record = in_a_loop(2, 0.15, r=np.concatenate([once[-500:], once]))
    for estimate in (fq.local_polynomial, fq.local_rational):
        frf = estimate(record, reference=True)
        # half a window beyond the reference's own
        assert 58 < frf.frequency[-1] < 62
        size = np.abs(frf.response[0, 0] - response_at(frf.omega)) ** 2 / frf.variance[0, 0]
        assert size.max() < 30
    for estimate in (fq.local_polynomial, fq.local_rational):
        for low in (62, 100):
            with pytest.raises(ValueError, match="reference is zero over"):
                estimate(record, band=(low, 200), reference=True)
    with pytest.raises(ValueError, match="drives no line"):
        fq.local_polynomial(record, band=(60.25, 200), reference=True)
    # a constant says nothing of the others
    lifted = fq.Record(record.u, record.y, DT, reference=record.reference + 1e5)
    assert len(fq.local_rational(lifted, reference=True).frequency) == len(frf.frequency)


def test_the_noise_of_lines_is_that_of_the_response():
    frf = fq.local_polynomial(in_a_loop(5, 0.05), band=(2, 200), reference=True)
    # each line's own window tells the one, the windows around each of its lines the other
    assert frf.line_noise.variance.mean() == pytest.approx(frf.variance.mean(), rel=0.2)
    part = frf.select((10, 20))
    at = (frf.frequency >= 10) & (frf.frequency <= 20)
    assert np.array_equal(part.line_noise.variance, frf.line_noise.variance[..., at])


def test_two_outputs_and_two_inputs_behind_two_references():
    """Each pair has its own noise; a table keeps it."""
    rng = np.random.default_rng(0)
    n, gains = 2000, np.array([[2.0, -1.0], [0.5, 1.5]])
    r, v = rng.standard_normal((2, n)), 0.1 * rng.standard_normal((2, n))
    # u = r − K y and y = G u + v without any dynamics
    K = np.diag([0.3, 0.2])
    y = np.linalg.solve(np.eye(2) + gains @ K, gains @ r + v)
    record = fq.Record((r - K @ y).T, y.T, 0.01, reference=r.T)
    frf = fq.local_polynomial(record, reference=True)
    size = np.abs(frf.response - gains[..., None]) ** 2 / frf.variance
    middle = np.median(size, axis=-1)
    assert np.all(middle > 0.4)
    assert np.all(middle < 1.1)
    assert np.mean(size < 9) > 0.96
    again = fq.FrequencyResponse.from_frame(frf.to_frame())
    assert np.allclose(again.line_noise.variance, frf.line_noise.variance, rtol=0.02)


def test_a_loop_without_noise_has_variances_that_are_no_less_than_rounding():
    frf = fq.local_rational(in_a_loop(1, 0.0), band=(2, 200), reference=True)
    assert np.isfinite(frf.variance).all()
    assert (frf.variance > 0).all()
    assert fq.fit(MODEL, frf, weights="noise")["d"] == pytest.approx(TRUE["d"], rel=1e-3)
