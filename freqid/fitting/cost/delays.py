"""What late inputs bring into a finite record from before its beginning.

On N samples z^(−q) U is the DFT of the input shifted round in a circle: its last q samples come
first. Those that really acted there, u(−q) … u(−1), are not in the record. Behind a free initial
state the two differ by q columns, one for each sample, the plant's response to an impulse among the
first q samples of the late input (theory, section 14); they are eliminated with the state.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.checks import ComplexArray, InputError

# values of all columns together beyond which a record is so long that its ends do not matter
_LONG = 4e7


def unknown_inputs(
    z: ComplexArray, unit: ComplexArray, shifts: Sequence[int], rows: int
) -> ComplexArray | None:
    """Late inputs that were not recorded, (inputs, columns, lines); None where there are none.

    ``unit`` (lines,) is a sample of one as the lines weight it, ``shifts`` are whole samples of
    delay for each input, negative where it is early. Raises InputError where these would be more
    than an eighth of the data's ``rows``, and explain noise.
    """
    # early inputs lack the samples after the end: N − 1 … N − r, and z^N is one
    powers = [range(q) if q > 0 else range(-1, q - 1, -1) for q in shifts]
    count = sum(map(abs, shifts))
    if count == 0 or count * len(z) > _LONG:
        return None
    if 8 * count > rows:
        samples = max(map(abs, shifts))
        raise InputError(f"a delay of {samples} samples leaves too little of the data")
    E = np.zeros((len(shifts), count, len(z)), complex)
    at = 0
    for i, some in enumerate(powers):
        for power in some:
            E[i, at] = unit * z ** -float(power)
            at += 1
    return E
