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
# pole of a loop's slow noise
SLOW = 0.95


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

    def clean(self):
        """The output without noise."""
        return fq.simulate(self.model, self.u(), self.dt).y

    def moved(self, size):
        """The plant with its first parameter, or its stiffness, off by that part."""
        name = "k" if self.plant == "two-mass" else self.model.free_parameters[0].name
        return self.model.with_values(**{name: (1 + size) * self.model[name]})

    def noise(self, number=0):
        e = np.random.default_rng([self.seed, number]).standard_normal(self.samples + 500)
        return scipy.signal.lfilter([np.sqrt(1 - self.pole**2)], [1, -self.pole], e)[500:]


# sizes where none is given: parts of the output, levels of the noise, parts of a parameter
SIZES = {"feedthrough": 0.3, "offset": 0.5, "drift": 1.0, "spikes": 12.0,
         "saturation": 0.03, "another mode": 0.4, "unlike experiments": 0.1,
         "unsteady": 0.1, "feedback": 0.3}  # fmt: skip


def measured(s, fault="none", size=None):
    """A record, or several, with a fault of that size in it."""
    u, clean = s.u(), s.clean()
    level = clean.std() / s.ratio
    if fault == "feedback":
        # a controller that answers within the sample looks like a direct term where it is weak
        return fq.Record(*looped(s, u, size or SIZES[fault], late=int(size is not None))[:2], s.dt)
    size = SIZES.get(fault) if size is None else size
    y = clean + added(s, fault, size) + level * s.noise()
    if fault == "saturation":
        y = clipped(clean + level * s.noise(), size)
    first = fq.Record(u, y, s.dt)
    if fault == "unlike experiments":
        other = fq.simulate(s.moved(size), u, s.dt).y + level * s.noise(1)
        return [first, fq.Record(u, other, s.dt)]
    return first


def added(s, fault, size):
    """What a fault of that size adds to the output (N,)."""
    u, dt, rng, clean = s.u(), s.dt, np.random.default_rng([11, s.seed]), s.clean()
    scale = clean.std()
    if fault == "delay":
        size = rng.uniform(0.3, 3) if size is None else size
        late = dataclasses.replace(s.model, input_delay=size * dt)
        return fq.simulate(late, u, dt).y - clean
    if fault == "hold rejected":
        fast = np.interp(np.arange(5 * s.samples) / 5, np.arange(s.samples), u)
        return fq.simulate(s.model, fast, dt / 5).decimate(5).y - clean
    if fault == "feedthrough":
        return size * scale / u.std() * u
    if fault == "offset":
        return np.full(len(u), size * scale)
    if fault == "drift":
        return size * scale * np.linspace(-0.5, 0.5, len(u))
    if fault == "spikes":
        spike = np.zeros(len(u))
        spike[int(rng.integers(len(u)))] = size * scale / s.ratio
        return spike
    if fault == "another mode":
        values = {"w": 0.56 / dt, "z": 0.02, "g": 1.0}
        mode = fq.GreyBox(_mode, [fq.Parameter(n, v) for n, v in values.items()])
        y = fq.simulate(mode, u, dt).y
        return size * scale / y.std() * y
    if fault == "unsteady":
        return _changed(s, u, size) - clean
    return np.zeros(len(u))


def clipped(y, part):
    """An output (N,) of which that part lies beyond a limit."""
    limit = np.quantile(np.abs(y), 1 - part)
    return np.clip(y, -limit, limit)


def _changed(s, u, size):
    """The plant changes midway; its state goes on."""
    middle, x, y = len(u) // 2, None, []
    for model, part in ((s.model, u[:middle]), (s.moved(size), u[middle:])):
        A, B, C, D = model.state_space()
        A, B, C, D, _ = scipy.signal.cont2discrete((A, B, C, D), s.dt)
        _, y_part, states = scipy.signal.dlsim((A, B, C, D, 1), part, x0=x)
        x = A @ states[-1] + B[:, 0] * part[-1]
        y.append(y_part[:, 0])
    return np.concatenate(y)


def looped(s, r, size, number=0, late=0):
    """Input, output and noise of the lag under u = r − y, so many samples late, with slow noise as
    large as that part of the signal.
    """
    e = dataclasses.replace(s, pole=SLOW).noise(number)
    v = size * s.clean().std() * e
    phi = np.exp(-20 * s.dt)
    gamma = 2.5 * (1 - phi)
    x, u, y = 0.0, np.zeros(len(r)), np.zeros(len(r))
    for k in range(len(r)):
        y[k] = x + v[k]
        u[k] = r[k] - (y[k - late] if k >= late else 0.0)
        x = phi * x + gamma * u[k]
    return u, y, v
