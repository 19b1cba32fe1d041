"""One verdict on an estimate: trust, doubt or do not use, with its reasons."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from freqid.fitting.cost.stamped_experiments import StampedExperiment
from freqid.fitting.search.verdict import RARE
from freqid.fitting.uncertainty.parts_of_values import parts_of_values
from freqid.fitting.uncertainty.profiles import wider_than_linear
from freqid.fitting.uncertainty.rivals import rival_of
from freqid.models import GreyBox

if TYPE_CHECKING:
    from freqid.fitting.estimate import Estimate

Grade = Literal["trust", "doubt", "do not use"]

# starts after which one that is alone is a doubt
_MANY = 10
# relative standard error from which a value is not told, and from which error bars may not hold:
# the plant is no longer straight in it
_VAGUE, _LOOSE = 0.5, 0.25
# values more than unknowns from which these tell the noise
_TELLING = 5
# e-folds within the data beyond which a motion that grows is no drift of an integrator
_E_FOLDS = 3.0
# how often chance makes a gap to a black box as large that is next to none
_BESIDE = 0.3
# what makes numbers useless where it is what explains most of what is wrong, and the chance up to
# which it is certain to
_USELESS = frozenset(
    {
        "not converged",
        "no signal",
        "feedback",
        "swapped channels",
        "wrong sign",
        "hold rejected",
        "wrapped",
        "code",
    }
)
_SURE = 1e-6


@dataclass(frozen=True)
class Verdict:
    """``grade``: ``"trust"``, ``"doubt"`` or ``"do not use"``; ``reasons``, the strongest first."""

    grade: Grade
    reasons: list[str]

    @property
    def trusted(self) -> bool:
        """Whether the numbers may be used as they are."""
        return self.grade == "trust"

    @property
    def head(self) -> str:
        """The grade as a sentence."""
        return {
            "trust": "Nothing speaks against this estimate.",
            "doubt": "Not to be trusted as it is.",
            "do not use": "Do not use these numbers.",
        }[self.grade]

    def __repr__(self) -> str:
        return f"<Verdict {self.grade}: {'; '.join(self.reasons)}>"


def verdict(est: Estimate) -> Verdict:
    """What all that is known of an estimate comes to."""
    # a sentence that somebody else has added says neither its weight nor its kind
    serious = [w for w in est.warnings if getattr(w, "severity", "serious") == "serious"]
    reasons = [str(w) for w in serious]
    std = np.sqrt(np.diag(est.covariance_matrix))
    if not est.converged and not any("not converged" in r for r in reasons):
        reasons.insert(0, f"not converged: {est.message}")
    if not est.converged or (serious and _useless(serious[0])):
        return Verdict("do not use", reasons)
    # what is held elsewhere is what a black box has more
    held = bool(serious) and getattr(serious[0], "kind", "") == "held"
    if est.witness.verdict == "lacking" and not held:
        reasons.append(est.witness.sentence)
    reasons += _lonely(est) + _barely(est)
    reasons += _open(est, std) or _untold(est, std) or _once(est, std)
    reasons = reasons or _besides(est, std) or _wider(est, std) or _rival(est, std)
    if reasons:
        return Verdict("doubt", reasons)
    return Verdict("trust", [_supported(est, std)])


def _useless(warning: str) -> bool:
    """Whether what a warning says, and is no chance, leaves numbers without a use."""
    chance = getattr(warning, "p_value", None) or 0.0
    return getattr(warning, "kind", "") in _USELESS and chance < _SURE


def _barely(est: Estimate) -> list[str]:
    """So few values more than unknowns that what they tell of the noise is a guess."""
    if est.problem is None or est.problem.prior is not None or est.minimum.exact:
        return []
    spare = est.problem.spare
    if not 0 < spare < _TELLING:
        return []
    return [
        f"barely told: {spare} values more than unknowns, those of initial states included, tell "
        "how large the noise is; use a longer record or a wider band"
    ]


def _lonely(est: Estimate) -> list[str]:
    """Many starts of which one alone ended here, where no black box can say that it is best."""
    if est.witness.verdict != "absent" or est.n_starts < _MANY or est.n_agreed > 1:
        return []
    if est.minimum.exact:
        # nothing better can be left
        return []
    return [
        f"not settled: of {est.n_starts} starts this one alone ended here, and no black box says "
        f"that nothing better is left ({est.witness.sentence}); begin from better values, start="
    ]


def _besides(est: Estimate, std: np.ndarray) -> list[str]:
    """Values that are hardly told, and a gap to a black box in which better ones may lie."""
    witness = est.witness
    if witness.verdict != "absent" or not witness.p_value < RARE:
        return []
    if est.problem is not None and est.minimum.exact:
        return []
    vague = _vague(est, std)
    if not vague:
        return []
    return [
        f"not settled: the data leave {', '.join(vague)} uncertain by more than half of their "
        f"values, and other values may explain them better ({witness.sentence}); begin from better "
        "values, start=, give what is known of them (with_prior, with_bounds), or excite more"
    ]


def _wider(est: Estimate, std: np.ndarray) -> list[str]:
    """Error bars that are not what the data allow, where a value is told loosely."""
    vague, loose = _vague(est, std), _vague(est, std, _LOOSE)
    if est.problem is None or est.minimum.exact or not loose:
        return []
    wide = [est.names[i] for i in wider_than_linear(est.minimum, est.scatter.change, std)]
    # of what is not told from zero anyway nothing more need be said
    wide = [n for n in wide if n not in vague]
    if not wide:
        return []
    left = f"leave {', '.join(vague)} open"
    if not vague:
        left = f"tell {', '.join(loose)} to no better than a quarter of the value"
    return [
        f"not told: the data {left}, and allow {', '.join(wide)} farther "
        "out than the error bars say, which hold where the plant is all but straight in its "
        "parameters; see est.intervals('profile'), give what is known of them (with_prior, "
        "with_bounds), or excite more"
    ]


def _rival(est: Estimate, std: np.ndarray) -> list[str]:
    """Another minimum that explains the data as well."""
    if est.problem is None or est.minimum.exact or not isinstance(est.model, GreyBox):
        return []
    vague = _vague(est, std)
    other = rival_of(est.minimum, std, bool(vague))
    if other is None:
        return []
    values = ", ".join(f"{n}={v:.4g}" for n, v in zip(est.names, other, strict=True))
    left = f"leave {', '.join(vague)} open, and " if vague else ""
    uneven = est.weights is None and est.model.n_outputs > 1
    weigh = (
        "fit with weights='noise' if one output hardly counts beside another, " if uneven else ""
    )
    return [
        f"not told: the data {left}explain {values} about as well, another minimum of the cost; "
        f"{weigh}give what is known of them (with_prior, with_bounds), or excite more"
    ]


def _open(est: Estimate, std: np.ndarray) -> list[str]:
    """What the data leave unknown, where no warning says it."""
    if np.isfinite(std).all():
        return []
    names = [n for n, s in zip(est.names, std, strict=True) if not np.isfinite(s)]
    if any(getattr(w, "kind", "") == "not identifiable" for w in est.warnings):
        return []
    return [f"not identifiable: the data do not determine {', '.join(names)}"]


def _untold(est: Estimate, std: np.ndarray) -> list[str]:
    """Values of which the data tell so little that the minimum may be one of several."""
    if not isinstance(est.model, GreyBox):
        return []
    relative, vague = _relative(est, std), _vague(est, std)
    outside = [w for w in est.warnings if getattr(w, "kind", "") == "not physical"]
    # of values that are off by so much error bars are no more than their order of magnitude
    most = bool(np.sum(relative > 2 * _VAGUE) >= max(len(relative) / 2, 2))
    most = most or len(vague) > max(len(relative) / 2, 1)
    within = [w for w in outside if w.severity == "minor"]
    if within and _runs_away(est):
        return [
            f"not told: {str(within[0]).split(';')[0].split(': ')[-1]} by less than two standard "
            "errors, and with that value the plant is unstable; keep it where it is physical "
            "(with_bounds), give what is known of it (with_prior), or excite more"
        ]
    if not most and (not outside or len(vague) < 2):
        return []
    which = f", and {str(outside[0]).split(';')[0].split(': ')[-1]}" if outside else ""
    return [
        f"not told: the data leave {', '.join(vague)} uncertain by more than half of their values"
        f"{which}; give what is known of them (with_prior, with_bounds), or excite more"
    ]


def _runs_away(est: Estimate) -> bool:
    """Whether a motion of the plant grows beyond all that the data hold, which it did not where the
    fit began.
    """
    duration = est.n_rows * est.dt
    begun = est.model.with_values(**{
        n: v for n, v in zip(est.names, est.nominal, strict=True) if n in est.model.values
    })  # fmt: skip
    grows, grew = (m.poles.real.max(initial=0.0) * duration > _E_FOLDS for m in (est.model, begun))
    return bool(grows and not grew)


def _once(est: Estimate, std: np.ndarray) -> list[str]:
    """One start along a valley that the data leave open, at no black box's own cost."""
    chance = est.witness.p_value if est.witness.verdict == "complete" else 0.0
    if not isinstance(est.model, GreyBox) or est.n_starts > 1 or chance > _BESIDE:
        return []
    vague = _vague(est, std)
    if not vague or est.minimum.exact:
        return []
    return [
        f"not settled: one start was made, and the data leave {', '.join(vague)} uncertain by more "
        "than half of their values: another may end better; ask for more, n_starts=30, or begin "
        "nearer, start="
    ]


def _vague(est: Estimate, std: np.ndarray, part: float = _VAGUE) -> list[str]:
    """Parameters of a grey box that are known to no more than a part of their values, half."""
    if not isinstance(est.model, GreyBox):
        return []
    return [n for n, r in zip(est.names, _relative(est, std), strict=True) if r > part]


def _relative(est: Estimate, std: np.ndarray) -> np.ndarray:
    """Standard errors as parts of their values."""
    return parts_of_values(std, est.values, est.names, est.model, est.hold)


def _supported(est: Estimate, std: np.ndarray) -> str:
    """What speaks for it."""
    text = f"{est.fit_percent:.2f} % of what was fitted is explained and the search converged"
    if isinstance(est.model, GreyBox):
        relative = _relative(est, std)
        if np.isinf(relative).any():
            nothing = [n for n, r in zip(est.names, relative, strict=True) if np.isinf(r)]
            text += f"; the data do not tell {', '.join(nothing)} from zero"
        elif np.isfinite(relative).any():
            worst = int(np.nanargmax(np.where(np.isfinite(relative), relative, np.nan)))
            name, size = est.names[worst], f"{100 * relative[worst]:.2g} %"
            # of what is late a part of a sample is told
            if std[worst] > 1.001 * relative[worst] * abs(est.values[worst]):
                size += " of a sample"
            text += f"; the least certain parameter, {name}, is known to {size}"
            text += ": the data do not tell it from zero" if relative[worst] > 0.5 else ""
    if est.witness.verdict == "complete":
        text += f"; {est.witness.sentence}"
    experiments = () if est.problem is None else est.problem.experiments
    if any(isinstance(e, StampedExperiment) for e in experiments):
        text += (
            "; of samples at times of their own nothing was asked but whether their stamps are "
            "late: what a fit to record.regular() lacks, this one may lack as well"
        )
    return text
