"""State-space models from spectra without iteration: frequency-domain subspace identification.

McKelvey, Akçay and Ljung, IEEE Trans. Automatic Control 41 (1996), with the transient of a finite
record as one more input, in a plane where the lines fill the unit circle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.fitting.black_box.held_inputs import inputs_of
from freqid.fitting.cost.experiments import SpectralExperiment
from freqid.lti import Plane, StateSpace, triangle


def plane_for(z: ComplexArray) -> Plane:
    """The plane in which the arc of the lines z is centred on a quarter turn."""
    half = np.sort(np.abs(np.angle(z))) / 2
    half = np.clip(half[half > 0], 1e-12, np.pi / 2 - 1e-6)
    if len(half) == 0:
        return Plane()
    # the map multiplies tan(angle/2) by (1+a)/(1−a); the arc is that of four lines in five
    ends = half[[len(half) // 10, len(half) - 1 - len(half) // 10]]
    stretch = 1 / np.sqrt(np.prod(np.tan(ends)))
    return Plane((stretch - 1) / (stretch + 1))


def identify(
    experiments: Sequence[SpectralExperiment], order: int, feedthrough: bool
) -> StateSpace:
    """Φ̃, Γ, C, D in the experiments' plane from their lines; ValueError where those are too few."""
    return inputs_of(experiments, *observed(experiments, order), feedthrough)


def observed(
    experiments: Sequence[SpectralExperiment], order: int
) -> tuple[FloatArray, FloatArray]:
    """Φ̃ and C, which the outputs' span alone tells; ValueError where the lines are too few."""
    columns = [columns_of(e, i, experiments) for i, e in enumerate(experiments)]
    w = np.concatenate([c[0] for c in columns])
    Y = np.concatenate([c[1] for c in columns], axis=1)
    V = np.concatenate([c[2] for c in columns], axis=1)
    return spanned(w, Y, V, order)


def spanned(
    w: ComplexArray, Y: ComplexArray, V: ComplexArray, order: int, rows: int = 2
) -> tuple[FloatArray, FloatArray]:
    """Φ̃ and C from points w (K,), outputs Y (p, K) and all that drives them, V (inputs, K), by
    ``rows`` blocks of rows for each order and two more.
    """
    p = len(Y)
    # twice as many block rows as the order: enough to see it, few enough to stay conditioned
    q = min(rows * order + 2, (2 * len(w)) // (p + len(V)) - 2)
    if q * p <= order:
        raise InputError(
            f"data hold {len(w)} lines; order {order} with {len(V)} inputs, transients counted, "
            "needs more: widen the band"
        )
    powers = w ** np.arange(q + 1)[:, None]
    Yq = (powers[:q, None] * Y).reshape(q * p, -1)
    Vq = (powers[:, None] * V).reshape(-1, len(w))
    stacked = np.concatenate([Vq, Yq])
    R = triangle(np.concatenate([stacked.real, stacked.imag], axis=1).T).T
    # what is left of the outputs when everything that the inputs explain at once is gone
    left = R[len(Vq) :, len(Vq) :]
    U = np.linalg.svd(left)[0][:, :order]
    A = np.linalg.lstsq(U[:-p], U[p:])[0]
    return A, U[:p]


def columns_of(
    e: SpectralExperiment, index: int, experiments: Sequence[SpectralExperiment]
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Lines, outputs and inputs (a transient each) of one experiment, one column a channel."""
    lines = e.lines
    # the alias with the most energy stands for all
    pick = lines.strongest()
    w = np.tile(e.points.z[pick], lines.Y.shape[1])
    common = lines.scale.mean(axis=0).reshape(1, -1)
    Y = lines.error(lines.Y).reshape(len(lines.Y), -1)
    V = lines.U[:, :, pick].reshape(len(lines.U), -1)
    if not lines.inside:
        V = V * common
    free = np.zeros((len(experiments), V.shape[1]), complex)
    if e.transient is not None:
        free[index] = common
    used = [i for i, other in enumerate(experiments) if other.transient is not None]
    return w, Y, np.concatenate([V, free[used]])
