"""What an estimate without data says of the plant that it came from: how far off it is."""

from __future__ import annotations

import numpy as np

from freqid.bias.apparent import true_plant
from freqid.bias.conditions import Expected
from freqid.fitting import Estimate, Finding, Severity
from freqid.models import GreyBox, Model, ModelLike

# parts of a value that are told, and that are too much
_TOLD, _MUCH = 1e-3, 0.01
# part of a parameter's size that is rounding
_ROUNDED = 1e-9
# standard errors, where there are any, that are told, and that are too many
_SEEN, _OUTSIDE = 1.0, 2.0


def biased(plant: ModelLike, est: Estimate, expected: Expected) -> list[Finding]:
    """The parameter that is farthest from the plant's, or the response where these are others.

    Of a sampled model nothing is said: the response through the hold is all that it has.
    """
    truth = true_plant(plant)
    if (
        isinstance(truth, GreyBox)
        and isinstance(est.model, GreyBox)
        and all(p.name in truth.values for p in est.model.free_parameters)
    ):
        return _parameters(truth, est)
    return [] if est.model.dt else _response(truth, est.model, expected)


def _parameters(truth: GreyBox, est: Estimate) -> list[Finding]:
    # a hold that is estimated is no parameter of the plant
    at = [i for i, n in enumerate(est.names) if n in truth.values]
    true = np.array([truth.values[est.names[i]] for i in at])
    off = est.values[at] - true
    std = np.sqrt(np.diag(est.covariance_matrix)[at])
    # of what is zero, parts of the unknown's own size
    size = np.linalg.norm(est.scatter.change.reshape(len(est.names), -1), axis=1)[at]
    part = np.abs(off) / np.where(true == 0, size, np.abs(true))
    # rounding scatters, too
    told = np.isfinite(std) & (std > _ROUNDED * size)
    errors = np.where(told, np.abs(off) / np.where(told, std, 1), 0)
    seen = np.where(told, errors > _SEEN, part > _TOLD)
    if not seen.any():
        return []
    much = np.where(told, errors > _OUTSIDE, part > _MUCH)
    worst = int(np.argmax(np.where(seen, errors, 0) if told.all() else np.where(seen, part, 0)))
    name, found = est.names[at[worst]], est.values[at[worst]]
    share = [f"{100 * off[worst] / (true[worst] or size[worst]):+.3g} %"]
    share += [f"{errors[worst]:.3g} standard errors"] if told[worst] else []
    text = (
        f"{name}={found:.5g} where the plant has {true[worst]:.5g} "
        f"({', '.join(share)}), however long the record: fit with the hold that the "
        "converter has, and a model of the plant's structure"
    )
    return [Finding("biased", text, _severity(bool(much.any())), float(part[worst]))]


def _response(truth: Model, model: Model, expected: Expected) -> list[Finding]:
    omega, weight = 2 * np.pi * expected.frequency, expected.weight
    if (omega == 0).any():
        omega, weight = omega[omega > 0], weight[omega > 0]
    G, found = truth.frequency_response(omega).response, model.frequency_response(omega).response
    size = float((weight * np.abs(G) ** 2).sum())
    part = np.sqrt(float((weight * np.abs(found - G) ** 2).sum()) / max(size, 1e-300))
    if part <= _TOLD:
        return []
    text = (
        f"the model's response is off by {100 * part:.3g} % of the plant's, weighted by the input, "
        "however long the record: fit with the hold that the converter has, and as many poles and "
        "zeros as the plant"
    )
    return [Finding("biased", text, _severity(part > _MUCH), part)]


def _severity(much: bool) -> Severity:
    return "serious" if much else "minor"
