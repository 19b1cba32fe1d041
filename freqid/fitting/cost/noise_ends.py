"""What the ends of a record do to noise that is weighed line by line.

Weights w(ω) = 1/variance whiten the noise as a filter A with |A|² = w does, which runs around: at
the beginning of the record it meets the end. Noise of an autoregression leaves there what its past
was, as an initial state does: polynomials in z⁻¹ over A (Pintelon and Schoukens, System
Identification: A Frequency Domain Approach, 2012, section 6.7.3). Left in, a few wild values meet
whatever jump the plant's own signals have there.
"""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import ComplexArray, FloatArray, IntArray

# terms at the most, and the part of the filter's energy that may lie beyond
_MOST, _BEYOND = 16, 1e-3


def noise_ends(number: IntArray, n_samples: int, weights: FloatArray) -> ComplexArray:
    """Shapes (q, outputs, K) that the past of the noise may have at the lines ``number`` (K,).

    Args: ``weights`` (outputs, K) at these lines of the DFT of ``n_samples``.
    """
    shapes: list[ComplexArray] = []
    angle = 2 * np.pi * number / n_samples
    for output, w in enumerate(weights):
        A, terms = _whitening(number, n_samples, w)
        for j in range(terms):
            shape = np.zeros((len(weights), len(number)), complex)
            shape[output] = np.exp(-1j * j * angle) / A
            shapes.append(shape)
    return np.array(shapes, complex).reshape(-1, len(weights), len(number))


def _whitening(number: IntArray, n_samples: int, w: FloatArray) -> tuple[ComplexArray, int]:
    """The filter of least phase with |A|² = w at the lines (K,), and how many terms its memory has.

    By the cepstrum (Oppenheim and Schafer, Discrete-Time Signal Processing, 2010, chapter 13).
    """
    every = np.arange(n_samples // 2 + 1)
    told = np.log(np.maximum(w, 1e-300))
    logarithm = np.interp(every, number, told) / 2
    if number[0] == 1 and len(number) > 1:
        # even about zero: taken for flat there, the filter would remember all of a record
        logarithm[0] = (4 * told[0] - told[1]) / 6
    cepstrum = scipy.fft.irfft(logarithm, n_samples)
    folded = np.zeros(n_samples)
    half = (n_samples + 1) // 2
    folded[0], folded[1:half] = cepstrum[0], 2 * cepstrum[1:half]
    if n_samples % 2 == 0:
        folded[half] = cepstrum[half]
    A = np.exp(scipy.fft.rfft(folded))
    impulse = scipy.fft.irfft(A, n_samples) ** 2
    beyond = 1 - np.cumsum(impulse) / impulse.sum()
    return A[number], min(int(np.argmax(beyond < _BEYOND)), _MOST)
