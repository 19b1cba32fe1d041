"""Random plants of order 1 to 6 and random experiments with them."""

from functools import partial

import numpy as np

import freqid as fq

INPUTS = ("chirp", "white", "prbs", "multisine", "steps")


def modal(lags, modes, **v):
    """Lags b/(s + a) and modes g w²/(s² + 2 z w s + w²) side by side."""
    n = lags + 2 * modes
    A, B, C = np.zeros((n, n), complex), np.zeros((n, 1), complex), np.zeros((1, n), complex)
    for i in range(lags):
        A[i, i], B[i, 0], C[0, i] = -v[f"a{i}"], v[f"b{i}"], 1
    for i in range(modes):
        at, w, z = lags + 2 * i, v[f"w{i}"], v[f"z{i}"]
        A[at, at + 1], A[at + 1, at], A[at + 1, at + 1] = w, -w, -2 * z * w
        B[at + 1, 0], C[0, at] = v[f"g{i}"] * w, 1
    real = all(np.isrealobj(x) for x in v.values())
    return (A.real, B.real, C.real, None) if real else (A, B, C, None)


def _apart(rng, count, decades, ratio):
    """Random numbers from 10^-decades to one, each at least ``ratio`` times the one before."""
    while True:
        drawn = np.sort(10 ** rng.uniform(-decades, 0, count))
        if (drawn[1:] >= ratio * drawn[:-1]).all():
            return drawn


def random_plant(rng):
    """A chain of masses, or lags and modes in parallel; frequencies within 0.02 to 0.8 Nyquist."""
    order = int(rng.integers(1, 7))
    if order in (3, 5) and rng.random() < 0.5:
        plant = fq.drivetrain((order + 1) // 2)
        values = {p.name: p.value * 3 ** rng.uniform(-1, 1) for p in plant.free_parameters}
        plant = plant.with_values(**values)
        top = np.abs(plant.poles).max()
        return plant, np.pi / top * rng.uniform(0.2, 0.7), "chain", order
    # lags, or modes, that lie closer together cannot be told apart in such noise by anything
    lags = order if order < 3 and rng.random() < 0.5 else order % 2
    modes = (order - lags) // 2
    top, v = 0.8 * np.pi, {}
    for i, a in enumerate(_apart(rng, lags, 1.3, 4)):
        v[f"a{i}"], v[f"b{i}"] = a * top, a * top * rng.choice([-1, 1]) * rng.uniform(0.3, 3)
    for i, w in enumerate(_apart(rng, modes, 1.5, 1.3)):
        v[f"w{i}"], v[f"z{i}"] = w * top, 10 ** rng.uniform(-2.3, -0.7)
        v[f"g{i}"] = rng.choice([-1, 1]) * rng.uniform(0.3, 3) * v[f"z{i}"] ** 0.5
    parameters = [fq.Parameter(n, x, physical=(-np.inf, np.inf)) for n, x in v.items()]
    return fq.GreyBox(partial(modal, lags, modes), parameters), 1.0, "modal", order


def random_input(rng, kind, n, dt):
    """(n,) samples."""
    nyquist = 0.5 / dt
    if kind == "chirp":
        return fq.chirp(0.01 * nyquist, 0.8 * nyquist, n * dt, dt)[:n]
    if kind == "white":
        return rng.standard_normal(n)
    if kind == "prbs":
        bits = int(np.clip(np.ceil(np.log2(n + 1)), 5, 16))
        return np.resize(fq.prbs(bits, dt), n).astype(float)
    if kind == "multisine":
        k = np.arange(1, max(int(0.4 * n), 3))
        k = k[:: max(len(k) // 200, 1)]
        t = np.arange(n) / n
        phases = rng.uniform(0, 2 * np.pi, len(k))
        return sum(np.cos(2 * np.pi * i * t + p) for i, p in zip(k, phases, strict=True))
    length = max(n // int(rng.integers(4, 20)), 5)
    return np.repeat(rng.choice([-1.0, 1.0, 0.5], n // length + 1), length)[:n]


def random_experiment(case):
    """Plant at its true values, a noisy record of it, what was drawn, and the generator."""
    rng = np.random.default_rng([12, case])
    plant, dt, kind, order = random_plant(rng)
    n = int(10 ** rng.uniform(2, np.log10(20000)))
    signal = str(rng.choice(INPUTS))
    snr = 10 ** rng.uniform(np.log10(0.5), 3)
    clean = fq.simulate(plant, random_input(rng, signal, n, dt), dt)
    noise = float(clean.y.std()) / snr
    record = clean.with_noise(noise, seed=int(rng.integers(2**31)))
    drawn = {"kind": kind, "order": order, "input": signal, "snr": round(snr, 3), "samples": n}
    return plant, record, drawn, rng


def moved(plant, rng, factor):
    """A start: every free parameter off by up to a factor, up or down."""
    return {p.name: p.value * factor ** rng.uniform(-1, 1) for p in plant.free_parameters}
