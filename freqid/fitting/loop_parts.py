"""A loop put together from its parts: a plant and a controller, each fitted to what it sees.

From a smooth reference to both ends a loop of order n has to be found in what a few large lines
leave. Between its own ends a controller is known to rounding, where it adds no noise of its own,
and a plant nearly so: closed, they are a start beside which the minimum lies.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from freqid.checks import InputError
from freqid.data import Record
from freqid.fitting.black_box.refinement import nested_model
from freqid.fitting.black_box.sampled_lines import lines_in_plane
from freqid.fitting.cost.charts import from_plane
from freqid.fitting.reading import Reading
from freqid.lti import StateSpace

# lines that the parts are fitted on
_LINES = 3000


def closed_from_parts(
    records: Sequence[Record], inputs: int, order: int, controllers: Sequence[int]
) -> list[StateSpace]:
    """Sampled loops from the reference to both ends, as ``records`` have them: first the plant's
    ``inputs``, then its outputs.

    One for each order of the ``controllers`` beside a plant of ``order`` states; none where a part
    cannot be fitted, or the loop is not stable.
    """
    plant = _fitted([_part(r, slice(0, inputs), slice(inputs, None)) for r in records], order)
    if plant is None:
        return []
    made = []
    for states in controllers:
        controller = _controller(records, inputs, states)
        if controller is not None:
            loop = _closed(plant, controller)
            if np.abs(np.linalg.eigvals(loop.A)).max(initial=0) < 1:
                made.append(loop)
    return made


def _part(record: Record, u: slice, y: slice, beside: bool = False) -> Record:
    """From some of the ends to others, the reference beside the first where it is asked for."""
    ends = record.outputs
    driving = [record.inputs] * beside + [ends[:, u]]
    return Record(np.column_stack(driving), ends[:, y], record.dt)


def _controller(records: Sequence[Record], inputs: int, states: int) -> StateSpace | None:
    """From the reference and the outputs to the inputs of the plant."""
    parts = [_part(r, slice(inputs, None), slice(0, inputs), beside=True) for r in records]
    if states:
        return _fitted(parts, states, direct=True)
    driving = np.concatenate([p.inputs for p in parts])
    gains = np.linalg.lstsq(driving, np.concatenate([p.outputs for p in parts]))[0].T
    none = np.zeros((0, 0))
    return StateSpace(none, none.reshape(0, gains.shape[1]), none.reshape(len(gains), 0), gains)


def _fitted(parts: Sequence[Record], order: int, direct: bool = False) -> StateSpace | None:
    """A sampled black box of what parts of records see, of the quality of a start."""
    with suppress(InputError, np.linalg.LinAlgError):
        lines, plane = lines_in_plane([Reading.of(p) for p in parts], _LINES)
        return from_plane(nested_model(lines, order, direct, stable=False), plane)
    return None


def _closed(plant: StateSpace, controller: StateSpace) -> StateSpace:
    """From the reference, the first of what drives the controller, to both ends.

    The plant has no direct term: u = Cₖ ξ + D_r r + D_y y and y = C x.
    """
    A, B, C, _ = plant
    p = len(C)
    q = controller.B.shape[1] - p
    K = controller
    (Br, By), (Dr, Dy) = np.split(K.B, [q], axis=1), np.split(K.D, [q], axis=1)
    states = np.block([[A + B @ Dy @ C, B @ K.C], [By @ C, K.A]])
    ends = np.block([[Dy @ C, K.C], [C, np.zeros((p, len(K.A)))]])
    return StateSpace(
        states, np.concatenate([B @ Dr, Br]), ends, np.concatenate([Dr, np.zeros((p, q))])
    )
