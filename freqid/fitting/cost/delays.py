"""What late inputs bring into a finite record from before its beginning.

On N samples z^(−q) U is the DFT of the input shifted round in a circle: its last q samples come
first. Those that really acted there, u(−q) … u(−1), are not in the record. So the first outputs,
which alone they reach but by the state that they leave, are left open, and the state that is free
is that at the first sample after them (theory, section 14). Unknown inputs in their place would say
the same, through a deconvolution of which nothing is left after some samples.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.fitting.cost.lines import Lines, Transient
from freqid.lti import on_circle

# values of all columns together beyond which a record is so long that its ends do not matter
_LONG = 4e7


def open_ends(
    lines: Lines, transient: Transient, shifts: Sequence[int], period: float, rows: int
) -> tuple[FloatArray | None, Transient]:
    """Rows (c, R) of outputs that unknown inputs reach, and the free motion from after them.

    ``shifts`` are whole samples of ``period`` (s) of delay for each input, negative where it is
    early. Raises InputError where these would be more than an eighth of the data's ``rows``.
    """
    # of early inputs those after the end are unknown
    first, last = (
        int(np.ceil(max(0, *(sign * q for q in shifts), 0) * period / transient.dt - 1e-9))
        for sign in (1, -1)
    )
    p, K = len(lines.Y), len(lines.omega)
    count = p * (first + last)
    if count == 0 or count * K > _LONG:
        return None, transient
    if 8 * count > rows:
        samples = max(map(abs, shifts))
        raise InputError(
            f"a delay of {samples} samples leaves open more than an eighth of the outputs, which "
            "inputs before the record have made: log for longer, or shift the input by what is "
            "known of the delay"
        )
    z = on_circle(lines.omega * transient.dt)
    turned = np.concatenate([_powers(z.conj(), first), z * _powers(z, last)])
    samples = transient.weight * turned
    each = np.zeros((p, len(turned), p, 1, K), complex)
    for output in range(p):
        each[output, :, output, 0] = samples
    after = transient.factor * np.repeat(z**-first, transient.aliases)
    return lines.rows(each.reshape(count, p, 1, K)), dataclasses.replace(transient, factor=after)


def _powers(z: ComplexArray, count: int) -> ComplexArray:
    """z⁰, z¹, … on the unit circle, (count, K), a product a row: powers take many times as long."""
    rows = np.ones((count, len(z)), complex)
    rows[1:] = z
    return np.cumprod(rows, axis=0)
