"""Plants, inputs, noise and faults of the studies."""

import dataclasses

import numpy as np
import scipy.signal

import freqid as fq


def _mode(w, z, g):
    return [[0, 1], [-w * w, -2 * z * w]], [[0], [1]], [[g * w * w, 0]], [[0]]


PLANTS = {
    "lag": (fq.first_order(b=50.0, a=20.0), 0.01),
    "mode": (
        fq.GreyBox(_mode, [fq.Parameter("w", 40.0), fq.Parameter("z", 0.05),
                           fq.Parameter("g", 1.0)]),
        0.01,
    ),
    "two-mass": (fq.two_mass(), 2e-3),
}  # fmt: skip
INPUTS = ("white", "chirp", "prbs", "multisine")
FAULTS = ("none", "delay", "feedthrough", "hold rejected", "offset", "drift", "spikes",
          "saturation", "another mode", "unlike experiments", "unsteady", "feedback")  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Setting:
    """One drawn experiment."""

    plant: str
    input: str
    samples: int
    pole: float
    ratio: float
    seed: int

    @classmethod
    def drawn(cls, case, plants=tuple(PLANTS)):
        rng = np.random.default_rng([7, case])
        return cls(
            str(rng.choice(plants)), str(rng.choice(INPUTS)), int(rng.choice([600, 1500])),
            float(rng.choice([0.0, 0.9])), float(rng.choice([10.0, 30.0])), case,
        )  # fmt: skip

    @property
    def model(self):
        return PLANTS[self.plant][0]

    @property
    def dt(self):
        return PLANTS[self.plant][1]

    def u(self):
        N, dt, seed = self.samples, self.dt, self.seed
        if self.input == "chirp":
            return fq.chirp(0.01 / dt, 0.3 / dt, N * dt, dt)
        if self.input == "prbs":
            return np.resize(fq.prbs(9, dt, clock=2), N)
        if self.input == "multisine":
            period = N * dt / 2
            u = fq.multisine((1 / period, 0.3 / dt), period, dt, crest="random", seed=seed)
            return np.resize(u, N)
        return fq.white_noise(N, seed=seed)

    def noise(self, number=0):
        e = np.random.default_rng([self.seed, number]).standard_normal(self.samples + 500)
        return scipy.signal.lfilter([np.sqrt(1 - self.pole**2)], [1, -self.pole], e)[500:]


def measured(s, fault="none"):
    """A record, or several, with a fault in it."""
    u, dt, rng = s.u(), s.dt, np.random.default_rng([11, s.seed])
    clean = fq.simulate(s.model, u, dt).y
    level = clean.std() / s.ratio
    y = clean + level * s.noise()
    if fault == "delay":
        late = dataclasses.replace(s.model, input_delay=rng.uniform(0.3, 3) * dt)
        y = fq.simulate(late, u, dt).y + level * s.noise()
    elif fault == "feedthrough":
        y = y + 0.3 * clean.std() / u.std() * u
    elif fault == "hold rejected":
        fast = np.interp(np.arange(5 * s.samples) / 5, np.arange(s.samples), u)
        slow = fq.simulate(s.model, fast, dt / 5).decimate(5)
        return fq.Record(slow.u, slow.y + level * s.noise(), dt)
    elif fault == "offset":
        y = y + 0.5 * clean.std()
    elif fault == "drift":
        y = y + clean.std() * np.linspace(-0.5, 0.5, s.samples)
    elif fault == "spikes":
        y[int(rng.integers(s.samples))] += 12 * level
    elif fault == "saturation":
        limit = np.quantile(np.abs(y), 0.97)
        y = np.clip(y, -limit, limit)
    elif fault == "another mode":
        w = 0.56 / dt
        mode = fq.simulate(fq.GreyBox(_mode, [fq.Parameter("w", w), fq.Parameter("z", 0.02),
                                              fq.Parameter("g", 1.0)]), u, dt).y  # fmt: skip
        y = y + 0.4 * clean.std() / mode.std() * mode
    elif fault == "unlike experiments":
        first = s.model.free_parameters[0].name if s.plant != "two-mass" else "k"
        other = fq.simulate(s.model.with_values(**{first: 1.1 * s.model[first]}), u, dt).y
        return [fq.Record(u, y, dt), fq.Record(u, other + level * s.noise(1), dt)]
    elif fault == "unsteady":
        y = _changed(s, u) + level * s.noise()
    elif fault == "feedback":
        u, y = _looped(s, u, clean.std())
    return fq.Record(u, y, dt)


def _changed(s, u, size=0.1):
    """The plant's first parameter, or its stiffness, changes midway; its state goes on."""
    name = s.model.free_parameters[0].name if s.plant != "two-mass" else "k"
    after = s.model.with_values(**{name: (1 + size) * s.model[name]})
    middle, x, y = len(u) // 2, None, []
    for model, part in ((s.model, u[:middle]), (after, u[middle:])):
        A, B, C, D = model.state_space()
        A, B, C, D, _ = scipy.signal.cont2discrete((A, B, C, D), s.dt)
        _, y_part, states = scipy.signal.dlsim((A, B, C, D, 1), part, x0=x)
        x = A @ states[-1] + B[:, 0] * part[-1]
        y.append(y_part[:, 0])
    return np.concatenate(y)


def _looped(s, r, size):
    """The lag under u = r − y with slow noise as large as a third of the signal."""
    v = 0.3 * size * dataclasses.replace(s, pole=0.95).noise()
    phi = np.exp(-20 * s.dt)
    gamma = 2.5 * (1 - phi)
    x, u, y = 0.0, np.zeros(len(r)), np.zeros(len(r))
    for k in range(len(r)):
        y[k] = x + v[k]
        u[k] = r[k] - y[k]
        x = phi * x + gamma * u[k]
    return u, y
