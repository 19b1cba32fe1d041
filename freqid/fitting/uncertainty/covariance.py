"""What the data determine: the inverse of JᵀJ, and the combinations that they leave open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import BoolArray, FloatArray

# columns of the Jacobian that are parallel to this are told apart by rounding alone
_PARALLEL = 1e-7
# an effect of this part of the data is none
_SILENT = 1e-10


@dataclass(frozen=True)
class Determined:
    """A ``half`` (P, k) of (JᵀJ)⁻¹, which unknowns are ``loose`` (P,), and the sentences that say
    why.
    """

    half: FloatArray
    loose: BoolArray
    sentences: list[str]

    @property
    def inverse(self) -> FloatArray:
        """(JᵀJ)⁻¹ (P, P) of what the data tell."""
        return self.half @ self.half.T

    def scatter(self, covariance: FloatArray) -> FloatArray:
        """The covariance (P, P), infinite for what is loose."""
        out = covariance.copy()
        out[self.loose, self.loose] = np.inf
        return out


def determined(
    jacobian: FloatArray, values: FloatArray, names: Sequence[str], size: float, scale: FloatArray
) -> Determined:
    """What the rows of a Jacobian tell of the unknowns.

    Args: jacobian (rows, P) by unknowns of order one, in units of the ``scale`` (P,); ``size`` the
    norm of the weighted data.
    """
    norms = np.linalg.norm(jacobian, axis=0)
    effect = norms * np.where(values == 0, 1, np.abs(values))
    # an unknown that has come to zero is not silent for that
    silent = ~(np.maximum(effect, norms) > _SILENT * size)
    sentences = [
        f"{name} has no effect on the data; fix it or excite it"
        for name, quiet in zip(names, silent, strict=True)
        if quiet
    ]
    half, loose = np.zeros((len(values), 0)), silent.copy()
    seen = np.flatnonzero(~silent)
    if len(seen):
        _, s, Vt = np.linalg.svd(jacobian[:, seen] / norms[seen], full_matrices=False)
        s = np.concatenate([s, np.zeros(len(seen) - len(s))])
        Vt = np.linalg.svd(jacobian[:, seen] / norms[seen])[2] if len(Vt) < len(seen) else Vt
        weak = s < _PARALLEL * s[0]
        for direction in Vt[weak]:
            step = direction / norms[seen]
            # in relative changes of the parameters
            change = step / np.where(values == 0, 1, values)[seen]
            change /= np.abs(change).max()
            members = np.abs(change) > 1e-3
            loose[seen[np.abs(direction) > 1e-4]] = True
            named = [names[i] for i in seen[members]]
            sentences.append(_combination(named, change[members], (step * scale[seen])[members]))
        half = np.zeros((len(values), np.count_nonzero(~weak)))
        half[seen] = ((Vt[~weak] / s[~weak, None]) / norms[seen]).T
    return Determined(half, loose, sentences)


def _combination(names: list[str], change: FloatArray, step: FloatArray) -> str:
    """Name what the data leave open, as relative changes that cancel one another.

    The ``step`` has the parameters' own units: a sum leaves it with equal and opposite parts.
    """
    parts = [f"{name} by {c:+.3g} %" for name, c in zip(names, change, strict=True)]
    text = f"{', '.join(names)}; changing {' and '.join(parts)} leaves the data"
    if len(names) == 2:
        relative, own = change[1] / change[0], step[1] / step[0]
        tried = [
            (abs(relative + 1), "product", "*"), (abs(relative - 1), "ratio", "/"),
            (abs(own + 1), "sum", "+"), (abs(own - 1), "difference", "-"),
        ]  # fmt: skip
        off, word, mark = min(tried)
        if off < 1e-3:
            return (
                f"{text} as they are: only the {word} {names[0]}{mark}{names[1]} is "
                "determined, so fix one"
            )
    return text + " as they are; fix one of them"
