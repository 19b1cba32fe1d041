"""A grey box whose matrices are made of another's, with one parameter more."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from freqid.models.grey_box import GreyBox
from freqid.models.matrices import Matrices, without
from freqid.models.parameter import Parameter


def wrapped(model: GreyBox, around: Callable[[Matrices], Matrices], own: Parameter) -> GreyBox:
    """The plant with the matrices that ``around`` makes of its function, passed ``own``, too.

    The plant's function is passed what it takes: delays only where it names them.
    """
    delays = [source for source in model.delay_sources if isinstance(source, str)]
    return dataclasses.replace(
        model, matrices=around(without(model.matrices, delays)),
        parameters=[*model.parameters, own], vectorized=False, jacobian=None,
    )  # fmt: skip
