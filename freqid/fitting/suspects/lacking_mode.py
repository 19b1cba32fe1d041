"""The mode that explains most of what a fit leaves at its lines: a pole that is tried at each."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray
from freqid.fitting.suspects.scene import Scene
from freqid.fitting.suspects.seen import Seen
from freqid.lti import StateSpace

# distances of a mode's poles from the unit circle that are tried, in half lines
_DISTANCES = (1.0, 4.0, 16.0)
# lines at which a mode is looked for; lines around one that tell it, and how many at least
_PLACES, _REACH, _LEAST = 80, 16.0, 6


def lacking_mode(scene: Scene, dt: float) -> StateSpace | None:
    """The mode, sampled each ``dt`` s, that explains most of what is left, or None."""
    if not all(s.experiment.lines.aliases == 1 and s.record is not None for s in scene.seen):
        return None
    best, found = 0.0, None
    ends = np.cumsum([len(s.left) for s in scene.seen])[:-1]
    parts = np.split(scene.variance[: sum(len(s.left) for s in scene.seen)], ends)
    views = [_View(s, v, dt) for s, v in zip(scene.seen, parts, strict=True)]
    for distance in _DISTANCES:
        poles = max(views, key=lambda v: v.N).poles(distance)
        if not len(poles):
            continue
        told = [view.explained(poles, distance) for view in views]
        gains = np.sum([each for each, _ in told], axis=0)
        i = int(np.argmax(gains))
        if gains[i] > best:
            best, found = gains[i], (poles[i], max(told, key=lambda t: t[0][i])[1][i])
    if found is None:
        return None
    pole, residues = found
    U, s, Vh = np.linalg.svd(residues)
    c, b = U[:, :1] * s[0], Vh[:1]
    return StateSpace(
        np.array([[pole.real, -pole.imag], [pole.imag, pole.real]]),
        np.concatenate([b.real, b.imag]),
        np.concatenate([2 * c.real, -2 * c.imag], axis=1),
        np.zeros((len(c), b.shape[1])),
    )


class _View:
    """What one experiment leaves at its lines, in units of the noise."""

    def __init__(self, s: Seen, variance: FloatArray, dt: float) -> None:
        lines = s.experiment.lines
        self.N = s.grid[0]
        shape = s.n_outputs, -1
        noise = np.sqrt(np.maximum(variance[::2], 1e-300)).reshape(shape)
        # errors are model less data
        self.lacking = -s.left.view(complex).reshape(shape) / noise
        scale = lines.scale[:, 0] if not lines.inside else np.ones_like(noise)
        self.weight = scale / noise
        self.U = lines.U[:, 0]
        self.angle = lines.omega * dt
        self.z = np.exp(1j * self.angle)

    def poles(self, distance: float) -> ComplexArray:
        """Poles so many half lines from the unit circle, where most is left around them."""
        step = np.pi / self.N * distance
        width = max(int(distance), 1)
        power = (np.abs(self.lacking) ** 2).sum(axis=0)
        around = scipy.ndimage.uniform_filter1d(power, width, mode="nearest")
        at = np.argsort(around)[-_PLACES:]
        inside = at[(self.angle[at] > step) & (self.angle[at] < np.pi - step)]
        poles: ComplexArray = np.exp(-step + 1j * self.angle[inside])
        return poles

    def explained(self, poles: ComplexArray, distance: float) -> tuple[FloatArray, ComplexArray]:
        """How much a mode with each of these poles, so many half lines from the circle, explains
        (S,), and its residues (S, outputs, inputs).
        """
        reach = np.pi / self.N * max(_REACH * distance, 2 * _LEAST)
        at = np.angle(poles)
        first, last = (np.searchsorted(self.angle, at + way * reach) for way in (-1, 1))
        near = first[:, None] + np.arange(max(int((last - first).max()), 1))
        inside = near < last[:, None]
        near = np.minimum(near, len(self.angle) - 1)
        z, U = self.z[near], self.U[:, near].swapaxes(0, 1)
        one, other = (1 / (z - p[:, None]) for p in (poles, poles.conj()))
        both, between = (one + other)[:, None], 1j * (one - other)[:, None]
        basis = np.concatenate([U * both, U * between], axis=1)
        gain, residues = np.zeros(len(poles)), []
        for left, weight in zip(self.lacking, self.weight, strict=True):
            columns = basis * (weight[near] * inside)[:, None]
            gram = (columns @ columns.conj().swapaxes(1, 2)).real
            told = (columns.conj() @ left[near][..., None])[..., 0].real
            x = (np.linalg.pinv(gram, rcond=1e-10, hermitian=True) @ told[..., None])[..., 0]
            gain += (x * told).sum(axis=1)
            real, imaginary = np.split(x, 2, axis=1)
            residues.append(real + 1j * imaginary)
        return gain, np.stack(residues, axis=1)
