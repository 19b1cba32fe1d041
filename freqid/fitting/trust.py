"""Whether an estimate may be trusted: its covariance, and the sentences of ``est.warnings``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.checks import FloatArray
from freqid.models.parameter import Parameter

# columns of the Jacobian that are parallel to this are told apart by rounding alone
_PARALLEL = 1e-7


@dataclass(frozen=True)
class Uncertainty:
    """Covariance (P, P), infinite for what the data do not determine, and the reasons why."""

    covariance: FloatArray
    warnings: list[str]


def uncertainty(
    jacobian: FloatArray,
    values: FloatArray,
    names: Sequence[str],
    noise_variance: float,
    size: float,
    sizes: FloatArray | None = None,
) -> Uncertainty:
    """σ² (JᵀJ)⁻¹ at the estimate, and the parameters that it cannot separate.

    Args: jacobian (rows, P) by the parameters themselves; ``size`` the norm of the weighted data;
    ``sizes`` (P,) what counts as a change of a parameter that is next to zero.
    """
    P = len(values)
    norms = np.linalg.norm(jacobian, axis=0)
    effect = norms * np.where(values == 0, 1, np.abs(values))
    # a parameter that has come to zero is not silent for that
    reach = effect if sizes is None else np.maximum(effect, norms * sizes)
    silent = ~(reach > 1e-10 * size)
    warnings = [
        f"not identifiable: {name} has no effect on the data; fix it or excite it"
        for name, quiet in zip(names, silent, strict=True)
        if quiet
    ]
    covariance = np.zeros((P, P))
    loose = silent.copy()
    seen = np.flatnonzero(~silent)
    if len(seen):
        _, s, Vt = np.linalg.svd(jacobian[:, seen] / norms[seen], full_matrices=False)
        s = np.concatenate([s, np.zeros(len(seen) - len(s))])
        Vt = np.linalg.svd(jacobian[:, seen] / norms[seen])[2] if len(Vt) < len(seen) else Vt
        weak = s < _PARALLEL * s[0]
        for direction in Vt[weak]:
            # in relative changes of the parameters
            change = direction / effect[seen]
            change /= np.abs(change).max()
            members = np.abs(change) > 1e-3
            loose[seen[np.abs(direction) > 1e-4]] = True
            warnings.append(_combination([names[i] for i in seen[members]], change[members]))
        half = (Vt[~weak] / s[~weak, None]) / norms[seen]
        covariance[np.ix_(seen, seen)] = noise_variance * half.T @ half
    covariance[loose, loose] = np.inf
    return Uncertainty(covariance, warnings)


def coloured(
    inverse: FloatArray, score: FloatArray | None, scale: FloatArray, white: FloatArray
) -> FloatArray:
    """H⁻¹ M H⁻¹ from H⁻¹ (P, P) and M in scaled unknowns; ``white`` where there is no M."""
    if score is None:
        return white
    known = np.isfinite(inverse)
    half = np.where(known, inverse, 0)
    return np.where(known, half @ (score / np.outer(scale, scale)) @ half, np.inf)


def _combination(names: list[str], change: FloatArray) -> str:
    """Name what the data leave open, as relative changes that cancel one another."""
    parts = [f"{name} by {c:+.3g} %" for name, c in zip(names, change, strict=True)]
    text = f"not identifiable: {', '.join(names)}; changing {' and '.join(parts)} leaves the data"
    if len(names) == 2:
        ratio = change[1] / change[0]
        if abs(ratio + 1) < 1e-3:
            text += (
                f" as they are: only the product {names[0]}*{names[1]} is determined, so fix one"
            )
            return text
        if abs(ratio - 1) < 1e-3:
            text += f" as they are: only the ratio {names[0]}/{names[1]} is determined, so fix one"
            return text
    return text + " as they are; fix one of them"


def physical_warnings(
    parameters: Sequence[Parameter], values: FloatArray, std: FloatArray | None = None
) -> list[str]:
    """One sentence for each parameter outside its physical range or at the edge of its bounds."""
    warnings = []
    errors = np.zeros(len(values)) if std is None else std
    for p, value, error in zip(parameters, values, errors, strict=True):
        low, high = p.physical
        if not low <= value <= high:
            beyond = low - value if value < low else value - high
            why = "check the hold that was assumed and the band"
            if beyond < 2 * error:
                why = "by less than two standard errors, so that the data allow a physical value"
            named = f"{p.name}={value:.6g} {p.unit}".rstrip()
            warnings.append(f"not physical: {named} lies outside [{low:g}, {high:g}]; {why}")
        for bound in (p.lower, p.upper):
            if np.isfinite(bound) and abs(value - bound) <= 1e-6 * max(
                abs(bound), abs(value), error if np.isfinite(error) else 0.0
            ):
                warnings.append(
                    f"edge of a bound: {p.name}={value:.6g} is at its bound {bound:g}; the data "
                    "want it beyond"
                )
    return warnings
