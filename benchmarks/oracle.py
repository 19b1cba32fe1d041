"""Sampled matrices, responses and derivatives against fifty digits, over random plants.

    python benchmarks/oracle.py 10000            about an hour; resumed where it was interrupted
    python benchmarks/oracle.py 100 --out few.csv

Orders 1 to 12, up to 3 inputs and outputs; stable, unstable, integrating, defective, nearly
defective, light and stiff plants with time constants from 1e-6 to 1e3 s; zero- and first-order
holds and band-limited inputs. Errors are relative to the largest entry of a matrix, or of a
response at its line.
"""

import argparse
from functools import partial
from pathlib import Path

import mpmath
import numpy as np
from search.store import resumed
from table import show

import freqid as fq
from freqid.lti import (
    VISIBLE,
    Linearisation,
    StateSpace,
    basis_of,
    points,
    response_and_derivatives,
    rounding,
)

KINDS = ("stable", "unstable", "integrating", "defective", "close", "light", "stiff")
HOLDS = ("zoh", "foh", "bl")
WANTED = 1e-11
# lines of a plant, and the step of a derivative, whose own error is its square
_LINES, _STEP = 3, "1e-20"


def random_plant(case):
    """A, B, C, D, a direction of each, the kind, the hold's name and a sample time."""
    rng = np.random.default_rng([17, case])
    kind, hold = str(rng.choice(KINDS)), str(rng.choice(HOLDS))
    n, m, p = int(rng.integers(1, 13)), int(rng.integers(1, 4)), int(rng.integers(1, 4))
    A = np.zeros((n, n))
    at = 0
    decades = (-6, 3) if kind == "stiff" else (-1.5, 0.5)
    while at < n:
        rate = 10 ** -rng.uniform(*decades)
        if at + 1 < n and rng.random() < 0.6:
            damping = 10 ** rng.uniform(-4, -2) if kind == "light" else rng.uniform(0.05, 0.9)
            A[at : at + 2, at : at + 2] = [[0, rate], [-rate, -2 * damping * rate]]
            at += 2
        else:
            A[at, at] = -rate
            at += 1
    if kind == "unstable":
        A += 0.5 * np.abs(np.linalg.eigvals(A)).max() * np.eye(n)
    elif kind == "integrating":
        A[0] = 0
    elif kind == "defective":
        A = np.diag(np.full(n, -rng.uniform(0, 2))) + np.diag(np.ones(n - 1), 1)
    elif kind == "close":
        # lags in a row whose rates agree to many digits
        apart = 10 ** rng.uniform(-16, -1, n) * rng.standard_normal(n)
        A = np.diag(-rng.uniform(0, 2) * (1 + apart)) + np.diag(np.ones(n - 1), 1)
    if kind not in ("defective", "close"):
        # a change of states that is well conditioned
        T = np.linalg.qr(rng.standard_normal((n, n)))[0] * 10 ** rng.uniform(-0.5, 0.5, n)
        A = T @ A @ np.linalg.inv(T)
    B, C = rng.standard_normal((n, m)), rng.standard_normal((p, n))
    D = rng.standard_normal((p, m)) * (rng.random() < 0.3)
    size = float(np.abs(np.linalg.eigvals(A)).max()) or 1.0
    dt = float(10 ** rng.uniform(-2, 0.3)) / (size if kind != "stiff" else 10 ** rng.uniform(-1, 3))
    # entries move by parts of themselves, as they do with parameters
    moves = [M * rng.standard_normal(M.shape) for M in (A, B, C, D)]
    return (A, B, C, D), moves, kind, hold, dt, rng


def _matrix(M):
    return mpmath.matrix(np.asarray(M).tolist())


def exact_sampled(A, B, hold, dt):
    """Phi, gamma and the part of the next sample, by the exponential of one block matrix."""
    n, m = A.rows, B.cols
    X = mpmath.zeros(n + 2 * m)
    X[:n, :n], X[:n, n : n + m] = A * dt, B * dt
    X[n : n + m, n + m :] = mpmath.eye(m)
    E = mpmath.expm(X)
    ramp = E[:n, n + m :] if hold == "foh" else mpmath.zeros(n, m)
    return E[:n, :n], E[:n, n : n + m] - ramp, ramp


def exact_responses(system, omega, hold, dt):
    """C (zI - phi)^-1 (gamma + z following) + D at each frequency."""
    A, B, C, D = system
    if hold == "bl":
        phi, gamma, following = A, B, B * 0
        places = [mpmath.mpc(0, w) for w in omega]
    else:
        phi, gamma, following = exact_sampled(A, B, hold, mpmath.mpf(dt))
        places = [mpmath.exp(mpmath.mpc(0, w) * mpmath.mpf(dt)) for w in omega]
    found = []
    for z in places:
        left, right = z * mpmath.eye(A.rows) - phi, gamma + z * following
        x = mpmath.zeros(A.rows, B.cols)
        for j in range(B.cols):
            x[:, j] = mpmath.lu_solve(left, right[:, j])
        found.append(C * x + D)
    return found


def _apart(ours, exact):
    exact = np.array(exact.tolist(), dtype=complex)
    return float(np.abs(ours - exact).max() / max(np.abs(exact).max(), 1e-300))


def one(case):
    """Errors of one plant."""
    system, moves, kind, name, dt, rng = random_plant(case)
    hold = {"zoh": fq.ZeroOrderHold(dt), "foh": fq.FirstOrderHold(dt), "bl": fq.BandLimited()}[name]
    A, B = system[:2]
    size = float(np.abs(np.linalg.eigvals(A)).max()) or 1.0
    top = np.pi / dt if name != "bl" else 3 * size
    omega = top * 10 ** rng.uniform(-2, 0, _LINES)
    told = rounding(StateSpace(*system), hold, omega)
    row = {"kind": kind, "hold": name, "order": len(A), "matrices": np.nan, "told": told}
    with mpmath.workdps(50):
        matrices = [_matrix(M) for M in system]
        if name != "bl":
            ours = hold.sampled(A, B)
            exact = exact_sampled(*matrices[:2], name, mpmath.mpf(dt))
            kept = [(o, e) for o, e in zip(ours, exact, strict=True) if np.abs(o).max() > 0]
            row["matrices"] = max(_apart(o, e) for o, e in kept)
        lin = Linearisation(StateSpace(*system), StateSpace(*(d[None] for d in moves)))
        G, dG = response_and_derivatives(basis_of(*lin).through(hold), points(omega, hold))
        step = mpmath.mpf(_STEP)
        at = partial(exact_responses, omega=[mpmath.mpf(w) for w in omega], hold=name, dt=dt)
        middle = at(matrices)
        up, down = (
            at([M + s * step * _matrix(d) for M, d in zip(matrices, moves, strict=True)])
            for s in (1, -1)
        )
        slopes = [(u - d) / (2 * step) for u, d in zip(up, down, strict=True)]
        row["response"] = max(_apart(G[..., k], e) for k, e in enumerate(middle))
        row["derivative"] = max(_apart(dG[0, ..., k], e) for k, e in enumerate(slopes))
    return row


def summary(table):
    """Rows for the printed table."""
    rows, lost = [], table[["matrices", "response", "derivative"]].max(axis=1) >= WANTED
    for what in ("matrices", "response", "derivative"):
        error = table[what].dropna()
        share, worst = 100 * (error < WANTED).mean(), table.loc[error.idxmax()]
        case = f"worst {worst['kind']}, {worst['hold']}, order {worst['order']:.0f}"
        rows.append(
            (f"{what}: below 1e-11 ({case})", f"{share:.2f} %, {error.max():.1g}", "99.9 %")
        )
    warned = table["told"] >= VISIBLE
    silent = int((lost & ~warned).sum())
    rows.append(("above 1e-11 and not warned of", f"{silent} of {int(lost.sum())}", "0"))
    idle = 100 * (warned & ~lost).sum() / len(table)
    rows.append(("warned of, and below 1e-11", f"{idle:.2f} %", ""))
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", type=int, nargs="?", default=10_000)
    parser.add_argument("--out", type=Path, default=Path("oracle_results.csv"))
    given = parser.parse_args()
    table = resumed(given.out, range(given.count), one)
    for row in summary(table):
        show(*row)


if __name__ == "__main__":
    main()
