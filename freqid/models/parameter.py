"""Parameter: a physical quantity, its value, its range and what was known of it before."""

from __future__ import annotations

import copy
import dataclasses
import math
from dataclasses import dataclass
from numbers import Real

from freqid.checks import InputError, finite, flag

# what is physical where nobody has said it: this very tuple, and no other that is equal
_UNSAID = (0, math.inf)


@dataclass(frozen=True)
class Parameter:
    """A physical parameter: its name, nominal value, unit and what is known of its range.

    ``lower`` and ``upper`` bound the search of a fit. ``physical`` (low, high) only flags: an
    estimate outside it is reported in ``est.warnings``, never prevented. Not given, it is (0, inf),
    or all numbers where the value itself is negative. ``prior`` (mean, standard
    deviation) is what was known before the experiment. Raises ValueError for a value that is not
    finite or outside its bounds, for bounds that cross, and for a fixed parameter with a prior.

    >>> Parameter("k", 1.5e5, unit="N m/rad", lower=0).name
    'k'
    >>> Parameter("k", 1.5e5).physical, Parameter("coupling", -20.0).physical
    ((0, inf), (-inf, inf))
    """

    name: str
    value: float
    unit: str = ""
    lower: float = -math.inf
    upper: float = math.inf
    fixed: bool = False
    physical: tuple[float, float] = _UNSAID
    prior: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise InputError(f"name={self.name!r} must be a non-empty string")
        object.__setattr__(self, "value", finite(f"parameter {self.name}", self.value))
        object.__setattr__(self, "fixed", flag(f"parameter {self.name}: fixed", self.fixed))
        if not isinstance(self.unit, str):
            raise InputError(f"parameter {self.name}: unit={self.unit!r} must be text, as 'N m'")
        for side in ("lower", "upper"):
            limit = getattr(self, side)
            if not isinstance(limit, Real) or (limit not in (-math.inf, math.inf)):
                finite(f"parameter {self.name}: {side}", limit)
        if not self.lower < self.upper:
            raise InputError(
                f"parameter {self.name}: lower={self.lower!r} must be below upper={self.upper!r}"
            )
        self._check_bounds()
        if self.physical is _UNSAID:
            # said from now on: the same at another value, as at an estimate, is as physical as here
            object.__setattr__(self, "physical", (0 if self.value >= 0 else -math.inf, math.inf))
        try:
            least, most = (float(v) for v in self.physical)
        except (TypeError, ValueError):
            least = most = math.nan
        if not least < most:
            raise InputError(
                f"parameter {self.name}: physical={self.physical!r} must be (low, high), low below "
                "high"
            )
        if self.prior is not None:
            try:
                mean, std = (float(v) for v in self.prior)
            except (TypeError, ValueError):
                raise InputError(
                    f"parameter {self.name}: prior={self.prior!r} must be (mean, std)"
                ) from None
            if not (math.isfinite(mean) and math.isfinite(std) and std > 0):
                raise InputError(
                    f"parameter {self.name}: prior={self.prior!r} must have a finite mean and a "
                    "positive standard deviation"
                )
            if self.fixed:
                raise InputError(
                    f"parameter {self.name} is fixed and has a prior; free it or drop the prior"
                )

    def changed(self, **fields: object) -> Parameter:
        """The same with other fields. Raises ValueError for what it cannot have.

        >>> Parameter("k", 1.5e5, unit="N m/rad").changed(value=2e5).value
        200000.0
        """
        if fields.keys() != {"value"}:
            return dataclasses.replace(self, **fields)  # type: ignore[arg-type]
        # a search does this at every point, where the rest is as it was checked already
        other = copy.copy(self)
        object.__setattr__(other, "value", finite(f"parameter {self.name}", fields["value"]))
        other._check_bounds()
        return other

    def _check_bounds(self) -> None:
        if not self.lower <= self.value <= self.upper:
            raise InputError(
                f"parameter {self.name}={self.value:g} lies outside its bounds "
                f"[{self.lower:g}, {self.upper:g}]; change the value or the bounds"
            )
