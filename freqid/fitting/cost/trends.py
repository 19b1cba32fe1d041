"""Records whose trends were taken off: what that does to the lines of a plant.

A polynomial that is taken off input and output apart leaves in the output the difference between
its own and what the plant makes of the input's: a polynomial of the same degree, and free motions
(Ljung, System Identification, 1999, section 14.1). Its size says nothing of the plant.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray, IntArray
from freqid.data import Record

# highest degree that is looked for, and the part of a signal that is but the rounding of what was
# taken off
_MOST, _ROUNDING = 3, 1e-10
# of records that have been asked already
_TAKEN: WeakKeyDictionary[Record, int] = WeakKeyDictionary()


def trends_taken(record: Record) -> int:
    """How many polynomials in time, from the constant up, were taken off all channels.

    Most records, long ones too, have a mean, and one sum of their samples says so.
    """
    if record not in _TAKEN:
        _TAKEN[record] = _taken(record)
    return _TAKEN[record]


def _taken(record: Record) -> int:
    channels = [record.outputs, record.inputs]
    for degree in range(_MOST + 1):
        if not all(_without(x, degree) for x in channels):
            return degree
    return _MOST + 1


def _without(x: FloatArray, degree: int) -> bool:
    """Whether samples (N, channels) hold nothing of a polynomial."""
    shape = _polynomial(len(x), degree) if degree else None
    held = x.sum(axis=0) if shape is None else shape @ x
    size = np.sqrt(len(x) if shape is None else shape @ shape)
    return bool((np.abs(held) <= _ROUNDING * size * np.sqrt(np.einsum("ij,ij->j", x, x))).all())


def trend_shapes(number: IntArray, n_samples: int, outputs: int, count: int) -> ComplexArray:
    """Shapes (q, outputs, K) that so many trends may have left at the lines ``number`` (K,), but
    for the constant, which the line at zero holds alone.
    """
    shapes = np.zeros((max(count - 1, 0), outputs, outputs, len(number)), complex)
    for degree in range(1, count):
        lines = scipy.fft.rfft(_polynomial(n_samples, degree))[number]
        shapes[degree - 1, range(outputs), range(outputs)] = lines
    return shapes.reshape(-1, outputs, len(number))


def polynomials(n_samples: int, count: int) -> FloatArray:
    """The first so many, from the constant up, over the record, (count, samples)."""
    each = [_polynomial(n_samples, degree) for degree in range(count)]
    return np.array(each, float).reshape(count, n_samples)


def _polynomial(n_samples: int, degree: int) -> FloatArray:
    """Legendre's, over the record."""
    along = np.linspace(-1, 1, n_samples)
    values: FloatArray = np.polynomial.legendre.Legendre.basis(degree)(along)
    return values
