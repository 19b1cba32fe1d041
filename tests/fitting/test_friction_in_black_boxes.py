"""Friction that a black box takes for damping: halves agree on what is wrong in both."""

import re

import numpy as np
import pytest
import scipy.signal

import freqid as fq

DT, W, Z = 0.01, 20.0, 0.1
FINE = 10


def spring(u, friction):
    """x'' = w² (u − friction·sign(x') − x) − 2 z w x' by Runge and Kutta; the position."""

    def slope(x, v, force):
        return v, W**2 * (force - friction * np.sign(v) - x) - 2 * Z * W * v

    x = v = 0.0
    h, y = DT / FINE, np.zeros(len(u))
    for k, force in enumerate(u):
        y[k] = x
        for _ in range(FINE):
            a1, b1 = slope(x, v, force)
            a2, b2 = slope(x + h / 2 * a1, v + h / 2 * b1, force)
            a3, b3 = slope(x + h / 2 * a2, v + h / 2 * b2, force)
            a4, b4 = slope(x + h * a3, v + h * b3, force)
            x += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            v += h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
    return y


def logged(friction, seed, n=2000, sign=1):
    rng = np.random.default_rng(seed)
    u = scipy.signal.lfilter([0.3], [1, -0.7], rng.standard_normal(n))
    u = u / u.std()
    y = sign * spring(u, friction)
    return fq.Record(u, y + 0.03 * y.std() * rng.standard_normal(n), DT)


@pytest.mark.parametrize("spec", [fq.OutputError(2), fq.TransferFunction(1, 2)])
@pytest.mark.parametrize("sign", [1, -1])
def test_damping_that_is_friction_is_doubted(spec, sign):
    """Trusted with 0.22 for 0.10, 16 of 16; whichever way the sensor looks."""
    est = fq.fit(spec, logged(0.3, 11, sign=sign))
    assert est.modes()["damping"].iloc[0] > 1.9 * Z
    assert est.verdict.grade == "doubt"
    assert est.warnings[0].kind == "friction"
    size = float(re.search(r"a friction of ([\d.]+) o[nf]", est.warnings[0])[1])
    assert size == pytest.approx(0.3, rel=0.15)


@pytest.mark.parametrize("sign", [1, -1])
def test_damping_that_is_a_little_friction_is_told(sign):
    """A third too large: what halves confirm is the frequency, and the sentence says the rest."""
    est = fq.fit(fq.OutputError(2), logged(0.1, 11, sign=sign))
    said = next(w for w in est.warnings if w.kind == "friction")
    pull = float(re.search(r"moves a mode's decay by ([\d.]+) %", said)[1])
    assert pull == pytest.approx(20, abs=8)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("spec", [fq.OutputError(2), fq.TransferFunction(1, 2)])
def test_friction_that_pulls_nothing_is_no_doubt(spec, seed):
    est = fq.fit(spec, logged(0.001 * seed, seed))
    assert est.modes()["damping"].iloc[0] == pytest.approx(Z, rel=0.05)
    assert est.verdict.trusted, est.warnings
