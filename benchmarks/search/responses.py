"""Are random continuous responses explained as well as their noise allows, and how fast?

The Cramer-Rao distance is that of the noise itself, seen through the tangent of all rational
functions of the order at the true one: no unbiased estimate comes nearer on average.
"""

import time
import warnings

import numpy as np
from threadpoolctl import threadpool_limits

import freqid as fq

LINES, NOISE = 400, 0.01


def random_poles(order, rng):
    """Upper half-plane poles (rad/s) of light modes over two decades, and of one lag if odd."""
    w = 2 * np.pi * np.sort(10 ** rng.uniform(0, 2, order // 2))
    z = 10 ** rng.uniform(-2.3, -1, order // 2)
    return np.append(w * (-z + 1j * np.sqrt(1 - z**2)), [-30.0] * (order % 2))


def experiment(case):
    """Order, s (K,), the true response, the noise, and its standard deviation (outputs, inputs, K).

    Cases go through the orders 4 to 12; every tenth is of order 8 with two inputs and outputs.
    """
    rng = np.random.default_rng([6, case])
    several = case % 10 == 9
    order, size = (8, 2) if several else (4 + case % 10, 1)
    poles = random_poles(order, rng)
    s = 2j * np.pi * np.geomspace(0.5, 200, LINES)
    parts = rng.standard_normal((2, len(poles), size, size))
    residues = (parts[0] + 1j * parts[1] * (poles.imag > 0)[:, None, None]) * np.abs(poles.real)[
        :, None, None
    ]
    if several:
        # one residue of rank one for each mode, as a plant of order eight has
        left, right = rng.standard_normal((2, len(poles), 2))
        residues = left[:, :, None] * right[:, None] * np.abs(poles.real)[:, None, None] + 0j
    G = sum(
        r[..., None] / (s - p) + (r.conj()[..., None] / (s - p.conj()) if p.imag else 0)
        for r, p in zip(residues, poles, strict=True)
    )
    std = NOISE * np.abs(G)
    n = rng.standard_normal((2, *G.shape))
    return order, poles, residues, s, G, std * (n[0] + 1j * n[1]) / np.sqrt(2), std


def cramer_rao(poles, residues, s, noise, std):
    """Length of the noise in the tangent space at a single channel's true response."""
    columns = []
    for p, r in zip(poles, residues[:, 0, 0], strict=True):
        # by the residue and by the pole, each beside that of the conjugate
        pairs = [
            (1 / (s - p), 1 / (s - p.conj())),
            (r / (s - p) ** 2, r.conj() / (s - p.conj()) ** 2),
        ]
        for a, b in pairs:
            columns += [a + b, 1j * (a - b)] if p.imag else [a]
    J = np.array(columns) / std
    J /= np.linalg.norm(J, axis=1, keepdims=True)
    Q = np.linalg.qr(np.ascontiguousarray(J).view(float).T)[0]
    return float(np.linalg.norm(Q.T @ (noise / std).view(float)))


def _vector_fitting(s, G, order):
    """Seconds and the response of scikit-rf's vector fitting."""
    import skrf
    from skrf.vectorFitting import VectorFitting

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        f = skrf.Frequency.from_f(s.imag / (2 * np.pi), unit="hz")
        network = skrf.Network(frequency=f, s=G[:, None, None], z0=50)
        begun = time.perf_counter()
        fit = VectorFitting(network)
        fit.vector_fit(order % 2, order // 2, fit_constant=False, fit_proportional=False)
        seconds = time.perf_counter() - begun
        return seconds, fit.get_model_response(0, 0, s.imag / (2 * np.pi))


def one(case):
    """The distance from the true response over the Cramer-Rao distance, and the time."""
    order, poles, residues, s, G, noise, std = experiment(case)
    frf = fq.FrequencyResponse(s.imag / (2 * np.pi), G + noise, variance=std**2)

    def fitted():
        begun = time.perf_counter()
        est = fq.fit(fq.TransferFunction(order - 1, order), frf, weights="noise")
        return time.perf_counter() - begun, est

    with threadpool_limits(1):
        times, est = [], None
        for _ in range(3):
            seconds, est = fitted()
            times.append(seconds)
        off = (est.model.frequency_response(s.imag).response - G) / std
        row = {"order": order, "channels": len(G), "seconds": float(np.median(times)),
               "distance": float(np.linalg.norm(off)), "cost": est.cost}  # fmt: skip
        if len(G) > 1:
            return {**row, "bound": np.nan, "skrf_seconds": np.nan, "skrf_distance": np.nan}
        row["bound"] = cramer_rao(poles, residues, s, noise[0, 0], std[0, 0])
        try:
            other = [_vector_fitting(s, (G + noise)[0, 0], order) for _ in range(3)]
        except ImportError:
            return {**row, "skrf_seconds": np.nan, "skrf_distance": np.nan}
        row["skrf_seconds"] = float(np.median([t for t, _ in other]))
        row["skrf_distance"] = float(np.linalg.norm((other[0][1] - G[0, 0]) / std[0, 0]))
        return row


def summary(table):
    """Rows for the printed table."""
    one_channel = table[table["channels"] == 1]
    ratio = one_channel["distance"] / one_channel["bound"]
    twelve = one_channel[one_channel["order"] == 12]
    several = table[table["channels"] > 1]
    vector = one_channel["skrf_distance"] / one_channel["bound"]
    ours, theirs = 1e3 * twelve["seconds"].median(), 1e3 * twelve["skrf_seconds"].median()
    freedom = several["cost"] / (4 * LINES)
    return [
        (f"responses: within 1.1 of Cramer-Rao, of {len(one_channel)}",
         f"{100 * (ratio <= 1.1).mean():.1f} % (worst {ratio.max():.3g})", "100 %"),
        ("responses: the same by vector fitting", f"{100 * (vector <= 1.1).mean():.1f} %", ""),
        ("responses: order 12, of vector fitting's time",
         f"{ours / theirs:.2f} ({ours:.0f} and {theirs:.0f} ms)", "2"),
        (f"responses: 2x2 of order 8, of {len(several)}: median and worst time",
         f"{1e3 * several['seconds'].median():.0f}, {1e3 * several['seconds'].max():.0f} ms",
         "200 ms"),
        ("responses: 2x2, worst cost a line", f"{freedom.max():.3f}", "1"),
    ]  # fmt: skip
