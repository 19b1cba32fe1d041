"""What the noise of samples makes of a gradient in time."""

from __future__ import annotations

import numpy as np
import scipy

from freqid.checks import FloatArray
from freqid.fitting.uncertainty.noise_spectrum import smoothed_power

# leverage that is believed at the most
MOST_LEVERAGE = 0.9


def of_series(J: FloatArray, left: FloatArray, Q: FloatArray) -> FloatArray:
    """JᵀΣJ of derivatives (P, outputs, N), Σ being the covariance that residuals (outputs, N) tell:
    the sum over all samples is that over the lines, each but the ends standing for two.

    Lines of which the parameters and initial states Q (q, outputs, N) have taken a part on
    themselves leave less than their noise, as a few lines do that tell a parameter (MacKinnon and
    White, J. Econometrics 29, 1985).
    """
    R, JF, QF = (scipy.fft.rfft(a, norm="ortho") for a in (left, J, Q))
    flat = J.reshape(len(J), -1)
    size = np.sqrt(np.maximum(np.einsum("ak,ak->a", flat, flat), 1e-300))
    unit = flat / size[:, None]
    half = np.linalg.pinv(unit @ unit.T, hermitian=True) / np.outer(size, size)
    own = np.einsum("aok,ab,bok->ok", JF.conj(), half, JF).real + (np.abs(QF) ** 2).sum(axis=0)
    R = R / np.sqrt(1 - np.minimum(own, MOST_LEVERAGE))
    twice = np.full(R.shape[-1], 2.0)
    twice[0] = 1.0
    if left.shape[-1] % 2 == 0:
        twice[-1] = 1.0
    seen = (JF * (smoothed_power(R) * twice)).reshape(len(J), -1)
    total: FloatArray = (seen @ JF.reshape(len(J), -1).conj().T).real
    return total
