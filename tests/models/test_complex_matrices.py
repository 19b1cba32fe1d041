"""Matrices of complex numbers are refused, and a function that cannot take them is not heard."""

import warnings

import numpy as np
import pytest

import freqid as fq

PARAMETERS = [fq.Parameter("w", 10.0), fq.Parameter("z", 0.1)]


def test_a_pair_of_poles_as_complex_numbers_is_refused_with_its_real_form():
    """Its imaginary parts were dropped: poles at −1, −1 under a warning of numpy's."""

    def pair(w, z):
        pole = w * (-z + 1j * np.sqrt(1 - z * z))
        return np.diag([pole, pole.conjugate()]), [[1.0], [1]], [[1.0, 1]], None

    with pytest.raises(ValueError, match=r"complex numbers in A; .*p.real, p.imag"):
        fq.GreyBox(pair, PARAMETERS).state_space()


def test_complex_numbers_without_imaginary_parts_are_real_ones():
    def pair(w, z):
        return np.array([[0, 1], [-w * w, -2 * z * w]], complex), [[0], [1]], [[1, 0]], None

    assert fq.GreyBox(pair, PARAMETERS).poles == pytest.approx(np.roots([1, 2, 100]), rel=1e-12)


def test_real_arrays_that_drop_a_complex_step_are_differentiated_in_silence():
    def filled(w, z):
        A = np.zeros((2, 2))
        A[0], A[1] = [0, 1], np.array([-w * w, -2 * z * w])
        return A, [[0.0], [1]], [[1.0, 0]], None

    u = fq.white_noise(400, seed=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plant = fq.GreyBox(filled, PARAMETERS)
        est = fq.fit(plant.with_values(w=12.0), fq.simulate(plant, u, 0.05))
    assert est["w"] == pytest.approx(10, rel=1e-7)
