"""How many digits of a plant's response and sampled matrices its own entries leave."""

from __future__ import annotations

import warnings

import numpy as np
import scipy

from freqid.checks import Array, FloatArray
from freqid.lti.bases import basis_of
from freqid.lti.holds import Hold, InputHolds, PeriodicHold
from freqid.lti.responses import points, transfer
from freqid.lti.state_space import StateSpace

# last digits by which entries of A are moved, and how often
_MOVED, _TIMES = 8 * float(np.finfo(float).eps), 3
# relative rounding from which on a user should know
VISIBLE = 1e-11
# and from which on it is said unasked
_SAID = 1e-9
# rates further apart than this, or closer as a part of the largest, cost digits; so do eigenvectors
# that are as close
_APART, _CLOSE = 100.0, 1e-3
# a response that is so small a part of that at a frequency beside it is a zero
_ZERO, _BESIDE = 1e-4, 0.9
# lines at which a response is tried
_LINES = 6


def rounding(plant: StateSpace, hold: Hold, omega: FloatArray, apart: float = _APART) -> float:
    """Largest relative change of the response at omega (rad/s), and of what a hold samples, as
    entries of A move by a few last digits: no algorithm can promise better.

    States whose rates lie many decades apart leave little to the slow ones where they are mixed;
    nothing is asked of those less than ``apart`` times apart.
    """
    if not len(plant.A) or not len(omega) or not _delicate(plant.A, apart):
        return 0.0
    # entries of one size are of one parameter: a spring pulls both masses alike
    own = np.unique(np.abs(plant.A), return_inverse=True)[1].reshape(plant.A.shape)
    rng, worst = np.random.default_rng(0), 0.0
    before = _seen(plant, hold, omega)
    for _ in range(_TIMES):
        A = plant.A * (1 + _MOVED * rng.choice([-1.0, 1.0], own.max() + 1)[own])
        # a last digit may make a long step grow beyond all numbers: nothing is told then
        with np.errstate(over="ignore", invalid="ignore"):
            after = _seen(StateSpace(A, *plant[1:]), hold, omega)
        if not all(np.isfinite(seen).all() for seen, _ in after):
            return np.inf
        for (old, floor), (new, _) in zip(before, after, strict=True):
            size = np.maximum(np.abs(old).max(axis=(-2, -1), initial=0), floor)
            gap = np.abs(new - old).max(axis=(-2, -1), initial=0)
            worst = max(worst, float((gap[size > 0] / size[size > 0]).max(initial=0)))
    return worst


def warn_of_rounding(plant: StateSpace, hold: Hold, omega: FloatArray, stacklevel: int = 3) -> None:
    """A RuntimeWarning where the response, or what is sampled, is told to less than nine digits."""
    if not len(omega):
        return
    at = np.unique(np.abs(omega[np.linspace(0, len(omega) - 1, _LINES).astype(int)]))
    for own in InputHolds.each(hold, 1):
        try:
            lost = rounding(plant, own, at)
        except (ArithmeticError, np.linalg.LinAlgError):
            return
        if lost >= _SAID:
            warnings.warn(sentence(plant, lost), RuntimeWarning, stacklevel=stacklevel)
            return


def sentence(plant: StateSpace, lost: float) -> str:
    """What was lost, and what to do, in words."""
    rates = np.abs(np.linalg.eigvals(plant.A))
    return (
        f"rounding: the model's matrices tell its response to {lost:.1g} only; their states mix "
        f"motions of up to {rates.max():.3g} rad/s with slow or nearly equal ones: take states of "
        "their own for these, or leave the fastest out"
    )


def _delicate(A: FloatArray, apart: float) -> bool:
    """Whether rates lie so far apart, or eigenvectors so close, that entries may not tell them."""
    if not np.isfinite(A).all():
        return False
    # in units of their own the states of any plant would look alike
    with np.errstate(invalid="ignore"):
        poles, V = np.linalg.eig(scipy.linalg.matrix_balance(A, permute=False)[0])
    size = np.abs(poles)
    largest = float(size.max())
    if largest == 0 or len(A) == 1:
        return False
    # rates that nearly agree are pulled apart by rounding; their vectors stay near each other
    gaps = np.abs(poles[:, None] - poles) + largest * np.eye(len(A))
    near = gaps.min() < _CLOSE * largest or np.linalg.cond(V) * _CLOSE > 1
    return bool(near or size.min() * apart < largest)


def _seen(
    plant: StateSpace, hold: Hold, omega: FloatArray
) -> list[tuple[Array, float | FloatArray]]:
    """The response, lines first, and the sampled matrices, with the least size that counts: what
    is left of a state after a long step is told against the state, exp(A·0) = I.
    """
    sampled = basis_of(plant).through(hold)

    def response(at: FloatArray) -> Array:
        return np.moveaxis(transfer(sampled, points(at, hold)), -1, 0)

    G = response(omega)
    # a zero, as a double integrator has one at half the sample rate, is told by what is beside it
    found = [(G, _ZERO * np.abs(response(_BESIDE * omega)).max(axis=(-2, -1), initial=0))]
    if isinstance(hold, PeriodicHold):
        phi, *gammas = hold.sampled(plant.A, plant.B)
        found += [(phi[None], 1.0), *((gamma[None], 0.0) for gamma in gammas)]
    return found
