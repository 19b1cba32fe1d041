"""What a fit to samples at times of their own cannot do, said before it begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from freqid.checks import InputError
from freqid.data import DataSet, StampedRecord
from freqid.lti import InputHolds, as_hold
from freqid.models import GreyBox

# what else a fit may be asked for: nothing of the kind, or what stands for that
_POSSIBLE: dict[str, tuple[object, ...]] = {
    "band": (None,), "weights": (None,), "initial_state": ("estimate", "zero"),
    "offset": (None,), "loss": ("linear",), "error": ("linear",), "reference": ("auto", False),
}  # fmt: skip


def check_stamped(
    model: object, sets: Sequence[DataSet], hold: object, asked: Mapping[str, object]
) -> None:
    """ValueError for stamped records beside options that need lines, a grid, or a black box."""
    stamped = [d for d in sets if isinstance(d, StampedRecord)]
    if not stamped:
        return
    cure = "or take record.regular(), which is resampled"
    if not isinstance(model, GreyBox):
        raise InputError(
            "the stamps of a record fit no grid, as a sampled model needs: fit a GreyBox, " + cure
        )
    if model.delay_sources:
        raise InputError(f"input_delay: samples at times of their own know no delays; {cure}")
    if isinstance(hold, str) and hold == "estimate":
        raise InputError(
            f"hold='estimate': stamps of their own say when the input changed; leave it out, {cure}"
        )
    for name, possible in _POSSIBLE.items():
        value = asked[name]
        if not any(value is p or (isinstance(value, str) and value == p) for p in possible):
            raise InputError(
                f"{name}={value!r}: a record with stamps of its own is fitted whole, in time, "
                f"without weights; leave {name} out, {cure}"
            )
    if hold is None or isinstance(hold, Mapping):
        return
    for d in stamped:
        for own in InputHolds.each(as_hold(hold, d.input_dt), 1):  # type: ignore[arg-type]
            period = getattr(own, "period", None)
            if period is not None and abs(period / d.input_dt - 1) > 1e-9:
                raise InputError(
                    f"hold={hold!r}: the input changes when its stamps say; give a name, 'zoh' or "
                    "'foh', or nothing"
                )
