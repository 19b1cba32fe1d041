"""Time-domain responses of sampled plants, and ``simulate``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike

from freqid.checks import (
    Array,
    ComplexArray,
    FloatArray,
    InputError,
    listed,
    numbers,
    positive,
    samples,
)
from freqid.data import Record, as_holds
from freqid.lti import (
    BandLimited,
    Hold,
    InputHolds,
    PeriodicHold,
    Sampled,
    ZeroOrderHold,
    keep_freed_memory,
    warn_of_rounding,
)
from freqid.models.conversion import ModelLike, as_model
from freqid.models.model import Model

# where the functions of ready-made plants are
_READY = "freqid.models.plants"


def propagate(phi: FloatArray, forcing: Array, initial: Array) -> FloatArray:
    """States x(0) … x(N−1), (…, n, N), of x(k+1) = Φ x(k) + f(k) from x(0).

    Args: phi (n, n), forcing (…, n, N), initial (…, n).
    """
    S, into, back = _triangular(phi)
    f = np.einsum("ij,...jk->...ik", into, forcing)
    forward = np.ones(len(S), bool)
    return np.einsum("ij,...jk->...ik", back, _chain(S, f, initial @ into.T, forward)).real


class FreeMotion:
    """All motions of x(k+1) = Φ x(k) + f(k), growing modes run backwards from their end.

    A mode that grows by 1e10 over the record leaves nothing of the others when it is run from an
    initial state; told by its final state it is as harmless as a decaying one.
    """

    def __init__(self, phi: FloatArray, n_samples: int) -> None:
        self.S, self.into, self.back = _triangular(phi)
        self.forward = np.abs(np.diag(self.S)) <= 1
        n = len(phi)
        quiet = np.zeros((n, n, n_samples), complex)
        motions = self.back @ _chain(self.S, quiet, np.eye(n, dtype=complex), self.forward)
        # real and imaginary parts of n complex motions: 2n real ones that span n dimensions
        self.motions = np.concatenate([motions.real, motions.imag])

    def particular(self, forcing: Array) -> FloatArray:
        """One motion, (…, n, N), under the forcing (…, n, N); all others differ by ``motions``."""
        f = np.einsum("ij,...jk->...ik", self.into, forcing)
        x = _chain(self.S, f, np.zeros(f.shape[:-1], complex), self.forward)
        return np.einsum("ij,...jk->...ik", self.back, x).real


def _triangular(phi: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Schur's form of Φ, and what takes states there and back; LinAlgError where a plant grows
    beyond all numbers.

    States in units of unlike size are balanced first: a unitary basis would mix them.
    """
    if not np.isfinite(phi).all():
        raise np.linalg.LinAlgError("the sampled matrices are not finite")
    scale = np.ones(len(phi))
    if len(phi) > 1:
        # of a lag that is gone within a sample the scales are beyond integers, which scipy asks for
        with np.errstate(invalid="ignore"):
            phi, (scale, _) = scipy.linalg.matrix_balance(phi, permute=False, separate=True)
    S, Q = scipy.linalg.schur(phi, output="complex")
    return S, Q.conj().T / scale, scale[:, None] * Q


def _chain(S: Array, f: Array, boundary: Array, forward: Array) -> Array:
    """x(k+1) = S x(k) + f(k) for upper triangular S: first-order filters from the last state up.

    ``boundary`` (…, n) is x(0) of a state that runs forward and x(N) of one that runs backward.
    """
    n, N = f.shape[-2:]
    x = np.empty((*f.shape[:-1], N), complex)
    for i in reversed(range(n)):
        drive = f[..., i, :] + np.einsum("j,...jk->...k", S[i, i + 1 :], x[..., i + 1 :, :])
        s, edge = S[i, i], boundary[..., i, None]
        if forward[i]:
            x[..., i, 0] = edge[..., 0]
            later = scipy.signal.lfilter([1.0], [1.0, -s], drive[..., :-1], zi=s * edge)[0]
            x[..., i, 1:] = later
        else:
            back = drive[..., ::-1]
            x[..., i, ::-1] = scipy.signal.lfilter([-1 / s], [1.0, -1 / s], back, zi=edge / s)[0]
    return x


def forcing(sampled: Sampled, u: FloatArray) -> FloatArray:
    """Γ u(k) + Γ⁺ u(k+1), (…, n, N), for u (m, N); the input keeps its last value after the end."""
    following = np.concatenate([u[:, 1:], u[:, -1:]], axis=1)
    return sampled.gamma @ u + sampled.gamma_next @ following


def late_sampled(plant: Model, hold: PeriodicHold) -> Sampled:
    """Sampled matrices of a plant whose inputs come late, for inputs shifted by whole samples.

    x(k+1) = Φ x(k) + Γ v(k) + Γ⁺ v(k+1) with v(k) = u(k − q) and q the delay in samples, broken
    ones counted: the input steps once in every period. Raises ValueError for another hold.
    """
    if not hold.constant:
        raise InputError(f"hold={hold!r}: a delay needs a zero-order hold or a band-limited input")
    system, h = plant.state_space(), hold.period
    whole = hold.sampled(system.A, system.B)
    gamma, following = whole.gamma.copy(), 0 * whole.gamma
    for i, (delay, q) in enumerate(zip(plant.delays, late_samples(plant, h), strict=True)):
        before = (delay / h - q + 1) * h
        if h - before <= 1e-12 * h:
            continue
        b = system.B[:, [i]]
        old, new = (ZeroOrderHold(t).sampled(system.A, b) for t in (before, h - before))
        gamma[:, [i]], following[:, [i]] = new.phi @ old.gamma, new.gamma
    return Sampled(whole.phi, gamma, following)


def late_samples(plant: Model, period: float) -> list[int]:
    """By how many samples of a period (s) each input comes late, broken ones counted."""
    return [int(np.ceil(delay / period - 1e-9)) for delay in plant.delays]


def later(u: FloatArray, steps: int) -> FloatArray:
    """u(k − steps) for every k of u (N,), zero before its start, held after its end."""
    at = np.arange(len(u)) - steps
    return np.where(at < 0, 0.0, u[np.clip(at, 0, len(u) - 1)])


def simulate(
    model: ModelLike,
    u: ArrayLike,
    dt: float,
    hold: Hold | str | Mapping[str, Hold | str] | None = None,
    initial_state: ArrayLike | None = None,
    input_names: Sequence[str] | None = None,
    output_names: Sequence[str] | None = None,
) -> Record:
    """Response of a model to an input, exact at the samples.

    Args:
        model: a GreyBox, an Estimate, a rational model or a control system. A discrete one must
            have ``dt`` as its sample time.
        u: input samples, (N,) or (N, inputs), ``dt`` seconds apart.
        hold: what the input does between its samples: None or ``"zoh"``, ``"foh"``, ``"bl"``
            (then the response is the periodic one, the input repeating for ever), or one of these
            for each input by name.
        input_names, output_names: of the channels; where not given those that the model was given,
            and ``u`` and ``y`` of a ready-made plant.
        initial_state: state of the plant at the first sample, (n,); None starts from rest.

    Returns a Record with that hold. Raises ValueError for wrong shapes or a hold whose period is
    not ``dt``. Warns (RuntimeWarning) where rounding of the matrices is visible in nine digits.

    >>> import freqid as fq
    >>> fq.simulate(fq.first_order(), fq.sine(8, 1, 1e-3), dt=1e-3)
    <Record u -> y: 1000 samples at 0.001 s, ZeroOrderHold(period=0.001)>
    """
    dt = positive("dt", dt, "s")
    u = samples("u", u)
    plant = as_model(model)
    system = plant.state_space()
    inputs = u.reshape(len(u), -1)
    names = plant.inputs or () if input_names is None else listed("input_names", input_names)
    if plant.dt and abs(plant.dt - dt) > 1e-9 * dt:
        raise InputError(f"dt={dt:g} s, but the model is discrete with dt={plant.dt:g} s")
    # a sampled model has its hold inside
    between = as_holds(hold, dt, plant.own_hold or ZeroOrderHold(dt), names)
    inside = plant.own_hold
    if inside is not None and [type(h) for h in InputHolds.each(between, 1)] != [
        type(h) for h in InputHolds.each(inside, 1)
    ]:
        raise InputError(
            f"hold={hold!r}: this model is of samples under {inside!r}, and knows no other; leave "
            "the hold out, or fit a TransferFunction or a GreyBox"
        )
    for each in InputHolds.each(between, 1):
        if isinstance(each, PeriodicHold) and abs(each.period - dt) > 1e-9 * dt:
            raise InputError(
                f"hold={each!r} must have the period dt={dt:g} s of the input's samples"
            )
    n, m = system.B.shape
    if inputs.shape[1] != m:
        raise InputError(f"u has {inputs.shape[1]} channels and the model {m} inputs; give as many")
    x0 = np.zeros(n) if initial_state is None else numbers("initial_state", initial_state)
    if x0.shape != (n,):
        raise InputError(f"initial_state has shape {x0.shape}; the model has {n} states")
    if not np.isfinite(x0).all():
        raise InputError(f"initial_state={initial_state!r:.80} must be finite numbers")
    if not plant.dt:
        warn_of_rounding(system, between, np.pi / dt * np.geomspace(0.1, 1, 3))
    keep_freed_memory()
    y = np.zeros((len(u), len(system.C)))
    groups = between.groups if isinstance(between, InputHolds) else [(between, list(range(m)))]
    for number, (each, members) in enumerate(groups):
        own = np.zeros_like(inputs)
        own[:, members] = inputs[:, members]
        begin = x0 if number == 0 else np.zeros(n)
        with np.errstate(over="ignore", invalid="ignore"):
            y += _outputs(plant, own, dt, each, begin, initial_state is not None)
    wrong = ~np.isfinite(y).all(axis=1)
    if wrong.any() and np.isfinite(inputs).all():
        raise InputError(
            f"the model's outputs leave the range of numbers after {dt * np.argmax(wrong):g} s: it "
            "is unstable there; simulate less, or change its parameters"
        )
    return Record(
        u,
        y[:, 0] if y.shape[1] == 1 and u.ndim == 1 else y,
        dt,
        hold=between,
        input_names=_given(plant, plant.inputs) if input_names is None else input_names,
        output_names=_given(plant, plant.outputs) if output_names is None else output_names,
        conditions=getattr(plant, "conditions", None),
    )


def _given(plant: Model, names: Sequence[str] | None) -> Sequence[str] | None:
    """Names of channels that a user gave the model; None for those of ready-made plants, whose
    records are u and y since the first version, and for the labels that control makes up.
    """
    function = getattr(plant, "matrices", None)
    ready = getattr(getattr(function, "func", function), "__module__", "") == _READY
    made_up = names is not None and all(re.fullmatch(r"[uy]\[\d+\]", name) for name in names)
    return None if ready or made_up else names


def _outputs(
    plant: Model, inputs: FloatArray, dt: float, hold: Hold, x0: FloatArray, begun: bool
) -> FloatArray:
    """Outputs (N, outputs) under one hold from the state x0, which was ``begun`` by a user."""
    system = plant.state_space()
    if plant.late and isinstance(hold, PeriodicHold):
        late, shifts = late_sampled(plant, hold), late_samples(plant, dt)
        seen = np.array([later(c, q) for c, q in zip(inputs.T, shifts, strict=True)])
        # an input of the next sample has come already when it is late by less than one
        following = np.array([later(c, q - 1) for c, q in zip(inputs.T, shifts, strict=True)])
        x = propagate(late.phi, late.gamma @ seen + late.gamma_next @ following, x0)
        return (system.C @ x + system.D @ seen).T
    # of a sampled model that integrates there is none that is periodic
    steps = plant.dt and (begun or plant.integrates or not isinstance(hold, BandLimited))
    if steps or isinstance(hold, PeriodicHold):
        sampled = plant.sampled(hold)
        x = propagate(sampled.phi, forcing(sampled, inputs.T), x0)
        return (system.C @ x + system.D @ inputs.T).T
    if begun:
        raise InputError("initial_state has no meaning for a band-limited, periodic input")
    omega = 2 * np.pi * np.fft.rfftfreq(len(inputs), dt)
    G = plant.frequency_response(omega, hold).response
    U = np.fft.rfft(inputs, axis=0)
    return np.fft.irfft(np.einsum("pmk,km->kp", G, U), n=len(inputs), axis=0)
