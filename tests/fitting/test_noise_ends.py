"""The whitening filter of weights, and what the past of the noise may have left, in closed form."""

import numpy as np
import pytest

from freqid.fitting.cost.noise_ends import noise_ends


@pytest.mark.parametrize("size", [400, 401])
def test_an_autoregression_has_one_term_for_each_of_its_poles(size):
    number = np.arange(size // 2 + 1)
    z = np.exp(-2j * np.pi * number / size)
    for poles in ([0.9], [0.6, -0.5]):
        A = np.prod([1 - p * z for p in poles], axis=0)
        shapes = noise_ends(number, size, np.abs(A[None]) ** 2)
        assert shapes.shape == (len(poles), 1, len(number))
        for j, shape in enumerate(shapes):
            assert np.allclose(shape[0] * A, z**j, atol=1e-6)


def test_white_noise_has_no_past():
    shapes = noise_ends(np.arange(51), 100, np.full((2, 51), 3.0))
    assert shapes.shape == (0, 2, 51)
    assert np.iscomplexobj(shapes)
