"""Black boxes beside the plant: none leaves more than a grey box that begins at the truth."""

import numpy as np
import pytest
import scipy

import freqid as fq
from freqid.fitting.black_box import refinement

MODES = ("wa", "wb", "wc", "za", "zb", "zc", "ga", "gb", "gc")


def three(wa, wb, wc, za, zb, zc, ga, gb, gc):
    """Three modes side by side: frequencies in rad/s, dampings, gains at resonance."""
    A, B, C = np.zeros((6, 6)), np.zeros((6, 1)), np.zeros((1, 6))
    for i, (w, z, g) in enumerate(((wa, za, ga), (wb, zb, gb), (wc, zc, gc))):
        at = slice(2 * i, 2 * i + 2)
        A[at, at] = [[0, w], [-w, -2 * z * w]]
        B[2 * i + 1, 0], C[0, 2 * i] = w, 2 * z * g
    return A, B, C, None


def random_plant(rng, signs):
    w = np.sort(2 * np.pi * np.exp(rng.uniform(np.log(0.05), np.log(0.3), 3)))
    z = np.exp(rng.uniform(np.log(0.003), np.log(0.03), 3))
    g = rng.uniform(0.5, 2, 3) * (rng.choice([-1, 1], 3) if signs else 1)
    values = zip(MODES, [*w, *z, *g], strict=True)
    return fq.GreyBox(three, [fq.Parameter(name, value) for name, value in values])


# 13, 96 and 174 ended 6 to 7 % above, trusted to be near for their descent was straight
@pytest.mark.study
@pytest.mark.parametrize("seed", [13, 96, 174, *range(6)])
def test_no_output_error_model_leaves_more_than_the_plant_itself(seed):
    plant = random_plant(np.random.default_rng(seed), signs=True)
    u = np.resize(fq.multisine((1 / 300, 0.49), 300, 1.0, seed=seed), 1100)
    clean = fq.simulate(plant, u, 1.0)
    record = clean.with_noise(0.15 * float(clean.y.std()), seed=seed + 1000)
    own = fq.fit(plant, record, n_starts=1)
    assert fq.fit(fq.OutputError(6), record).cost <= own.cost * (1 + 1e-6)


# 54 ended 13 and 35 % above, in noise whose own modes are as strong as the weakest of the plant
@pytest.mark.parametrize("seed", [54, 0, 1])
@pytest.mark.parametrize("spec", [fq.TransferFunction(5, 6), fq.OutputError(6)])
def test_no_black_box_of_a_short_record_in_coloured_noise_does(seed, spec):
    rng = np.random.default_rng(seed)
    plant = random_plant(rng, signs=False)
    u = fq.chirp(0.002, 0.45, 320, 1.0)
    y = fq.simulate(plant, u, 1.0).y
    e = scipy.signal.lfilter([1.0], [1.0, -0.9], rng.normal(size=620))[300:]
    record = fq.Record(u, y + 0.15 * y.std() * e / e.std(), 1.0)
    own = fq.fit(plant, record, n_starts=1)
    assert fq.fit(spec, record).cost <= own.cost * (1 + 1e-6)


def test_starts_that_were_counted_are_not_added_to(monkeypatch):
    tried = []
    own = refinement._random_poles
    monkeypatch.setattr(refinement, "_random_poles", lambda n, rng: tried.append(n) or own(n, rng))
    plant = random_plant(np.random.default_rng(0), signs=True)
    record = fq.simulate(plant, fq.white_noise(400, seed=0), 1.0)
    record = record.with_noise(0.5 * float(record.y.std()), seed=1)
    counted = {}
    for n_starts in ("auto", 1, 4):
        tried.clear()
        fq.fit(fq.OutputError(5), record, n_starts=n_starts)
        counted[n_starts] = len(tried)
    assert counted[1] == 0
    assert counted[4] > 0
    assert counted["auto"] > counted[4]


# numerators and poles of fourth-order plants; of 40 seeds the third ended 1 to 11 % above for ten
# white inputs and nine chirps, the first for five chirps, trusted with modes 12 standard errors off
FOURTH = [
    ([-0.36074413, 1.0148385, -0.99426503, 0.33728907],
     [0.934289 + 0.344922j, 0.934289 - 0.344922j, 0.920833, 0.7241]),
    ([-0.064865851, 0.14730184, -0.1529539, 0.043272302],
     [-0.137557 + 0.913915j, -0.137557 - 0.913915j, 0.954185 + 0.1368j, 0.954185 - 0.1368j]),
    ([0.21702886, -0.30397003, 0.18639092, -0.03633352],
     [-0.214244 + 0.75468j, -0.214244 - 0.75468j, 0.770746, 0.617088]),
]  # fmt: skip


@pytest.mark.parametrize("seed", [13, 17, 20, 29])
@pytest.mark.parametrize("plant", FOURTH)
@pytest.mark.parametrize("kind", ["white", "chirp"])
def test_two_modes_are_exchanged_as_well(plant, kind, seed):
    """Against scipy's least squares on samples, begun at the truth; little noise was no reason."""
    num, den = plant[0], np.real(np.poly(plant[1]))
    rng = np.random.default_rng(seed)
    n = 3000 if seed % 2 else 1000
    u = rng.standard_normal(n)
    if kind == "chirp":
        u = fq.chirp(0.5, 45, n / 100, 0.01)
    y = scipy.signal.lfilter([0, *num], den, u)
    e = scipy.signal.lfilter([1], [1, -0.9], rng.standard_normal(n + 300))[300:]
    y = y + 0.1 * y.std() * e / e.std()
    at_truth = scipy.optimize.least_squares(
        lambda x: scipy.signal.lfilter([0, *x[:4]], [1, *x[4:]], u) - y,
        [*num, *den[1:]], method="lm", x_scale="jac",
    )  # fmt: skip
    est = fq.fit(fq.OutputError(4), fq.Record(u, y, 0.01))
    assert est.cost <= 2 * at_truth.cost * (1 + 1e-6)


def test_no_order_of_a_measured_axis_leaves_more_than_stable_ones_or_the_order_below(measured):
    """Order 6 of the ruler robot ended 3.2 times above its stable one, with a motion that grows,
    and 7 above both.
    """
    record = fq.read(
        measured / "ruler_robot" / "swept_01.csv",
        inputs="motor", outputs=["angle", "acceleration"],
    )  # fmt: skip
    cost = {
        (n, stable): fq.fit(fq.OutputError(n, stable=stable), record, band=(1, 20)).cost
        for n in (6, 7) for stable in (False, True)
    }  # fmt: skip
    assert cost[6, False] <= cost[6, True] * (1 + 1e-6)
    assert cost[7, False] <= cost[7, True] * (1 + 1e-6)
    assert max(cost[7, False], cost[7, True]) <= cost[6, True] * (1 + 1e-6)


def test_a_direct_term_takes_nothing_away(measured):
    """Order 4 of the CD player's arm: 37.2 with a direct term, 33.2 is reached without."""
    record = fq.read(
        measured / "daisy" / "CD_player_arm.dat", dt=0.01, columns=["u1", "u2", "y1", "y2"],
        inputs=["u1", "u2"], outputs=["y1", "y2"],
    )  # fmt: skip
    own, direct = (fq.fit(fq.OutputError(4, feedthrough=D), record).cost for D in (False, True))
    assert direct <= own


def driven_by_levels(seed):
    """A random plant of two inputs or outputs, its record, order and the energy of its noise."""
    rng = np.random.default_rng(seed)
    n, (p, m) = int(rng.integers(2, 5)), [(1, 2), (2, 1), (2, 2)][rng.integers(3)]
    count, poles, A, i = int(rng.integers(300, 1000)), [], np.zeros((n, n)), 0
    while len(poles) < n:
        r = rng.uniform(0.8, 0.99)
        if n - len(poles) > 1 and rng.random() < 0.5:
            a = rng.uniform(0.05, 0.6)
            poles += [r * np.exp(1j * a), r * np.exp(-1j * a)]
        else:
            poles.append(r if rng.random() < 0.6 else rng.uniform(0, 0.5))
    while i < n:
        z, pair = poles[i], 2 if np.iscomplex(poles[i]) else 1
        own = [[z.real, z.imag], [-z.imag, z.real]]
        A[i : i + pair, i : i + pair] = np.array(own)[:pair, :pair]
        i += pair
    B, C = rng.standard_normal((n, m)), rng.standard_normal((p, n))
    u = np.repeat(rng.choice([-1.0, 1.0], (count // 3 + 1, m)), 3, axis=0)[:count]
    y = scipy.signal.dlsim((A, B, C, np.zeros((p, m)), 1.0), u)[1]
    noise = 10 ** rng.uniform(-2, -0.5) * y.std(axis=0) * rng.standard_normal(y.shape)
    return fq.Record(u, y + noise, 1.0), n, float((noise**2).sum())


@pytest.mark.study
@pytest.mark.parametrize("seed", [427, 441, 484])
def test_a_pole_at_the_end_of_the_circle_is_looked_at_again(seed):
    """These left more than their noise: a pole had run to -1, where nothing was."""
    record, order, noise = driven_by_levels(seed)
    assert fq.fit(fq.OutputError(order), record).cost < noise
