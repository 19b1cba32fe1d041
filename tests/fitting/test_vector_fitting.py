"""Poles that responses share, against those they were made with."""

import numpy as np
import pytest

from freqid.fitting.black_box.vector_fitting import shared_poles


def responses(poles, size, seed, noise=0.0):
    """Channels with these poles (upper half-plane and real), and their number."""
    rng = np.random.default_rng(seed)
    s = 2j * np.pi * np.geomspace(0.5, 200, 300)
    channels = []
    for _ in range(size):
        G = np.zeros(len(s), complex)
        for p in poles:
            r = abs(p.real) * (rng.standard_normal() + 1j * rng.standard_normal() * (p.imag > 0))
            G += r / (s - p) + (r.conjugate() / (s - np.conj(p)) if p.imag else 0)
        std = noise * np.abs(G) + 1e-12 * np.abs(G).max()
        G = G + std * (rng.standard_normal(len(s)) + 1j * rng.standard_normal(len(s))) / 2**0.5
        channels.append((s, G, 1 / std))
    return channels, sum(2 if p.imag else 1 for p in poles)


def nearest(found, poles):
    return max(np.abs(found - p).min() / abs(p) for p in poles)


@pytest.mark.parametrize("size", [1, 3, 6])
@pytest.mark.parametrize(
    "poles",
    [
        [-3.0],
        [-2 + 40j],
        [-20.0, -0.3 + 9j],
        [-0.1 + 9j, -0.2 + 9.6j, -5 + 300j],
        [-500.0, -1.0, -1 + 60j, -4 + 700j],
        [-w / 100 + 1j * w for w in np.geomspace(5, 1000, 8)],
        [4 + 50j, -1 + 200j],
    ],
)
def test_exact_responses_give_their_poles(poles, size):
    channels, count = responses(poles, size, len(poles) + size)
    found, left = shared_poles(channels, count, False, 1.3 * 300 * size)
    assert nearest(found, poles) < 1e-7
    assert len(found) == count
    assert left <= 1.3 * 300 * size


def test_close_modes_in_noise_are_found_by_larger_models():
    """From poles spread over the band alone one mode stood for both, and a real pole was idle."""
    poles = [-0.3084 + 15.068j, -0.0771 + 15.386j, -0.2931 + 10.25j, -0.4436 + 13.43j, -5 + 84j]
    for seed in range(10):
        channels, count = responses(poles, 1, seed, noise=0.01)
        found, left = shared_poles(channels, count, False, 1.3 * 300)
        assert left < 1.3 * 300
        assert nearest(found, poles) < 0.02


def test_a_direct_term_belongs_to_each_response():
    channels, count = responses([-1 + 30j], 2, 1)
    channels = [(s, G + i + 1, weight) for i, (s, G, weight) in enumerate(channels)]
    assert nearest(shared_poles(channels, count, True, 0.0)[0], [-1 + 30j]) < 1e-6


def test_what_is_not_a_number_is_refused():
    s = 2j * np.pi * np.arange(1, 50)
    with pytest.raises(np.linalg.LinAlgError):
        shared_poles([(s, np.full(49, np.nan + 0j), np.ones(49))], 2, False, 0.0)
