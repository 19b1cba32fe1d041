"""Local models next to where an input begins and ends, and fits to their responses."""

import numpy as np
import pytest

import freqid as fq

PLANT = fq.two_mass()
NAMES = [p.name for p in PLANT.free_parameters]
TRUE = np.array([PLANT[name] for name in NAMES])


def responses(low, high, dt, noise, count):
    clean = fq.simulate(PLANT, fq.chirp(low, high, duration=10, dt=dt), dt)
    size = noise * clean.y.std()
    records = [clean.with_noise(size, seed=seed) for seed in range(count)]
    return [fq.local_rational(record, band=(low, high)) for record in records]


@pytest.mark.parametrize(("low", "high", "dt"), [(5, 80, 1e-3), (10, 80, 0.5e-3)])
def test_fits_without_weights_have_error_bars_of_their_size(low, high, dt):
    """Half of the first windows was noise, which bent their denominators: 5 standard errors off on
    a third of a hertz, and parameters 1.4 to 1.8 of their bars off (rms), all of them trusted.
    """
    fits = [fq.fit(PLANT, each) for each in responses(low, high, dt, 0.002, 12)]
    values = np.array([[fit[name] for name in NAMES] for fit in fits])
    bars = np.array([np.sqrt(np.diag(fit.covariance_matrix)) for fit in fits])
    z = np.sqrt(np.mean(((values - TRUE) / bars) ** 2, axis=0))
    assert (z < 1.35).all(), z
    # of the inertia and the stiffness no more than a third of what it was
    error = np.sqrt(np.mean((values / TRUE - 1) ** 2, axis=0))
    assert (error[:2] < 3.5e-4).all(), error


def test_an_input_that_has_no_end_within_a_window_keeps_its_windows_centred():
    """White noise, a chirp of the whole band and one whose power falls with the frequency."""
    from freqid.frf.local_windows import Form, Lines, _centred, _first

    K, form = 900, Form(3, 3, 97)
    centres = np.arange(0, K, 4)
    noise = np.random.default_rng(0).standard_normal((2, K))
    for U in (noise[0] + 1j * noise[1], np.ones(K), 1 / np.arange(5.0, K + 5)):
        data = U[None, None].astype(complex)
        lines = Lines(data, data, np.arange(K) / 10, np.ones(K, bool))
        assert (_first(lines, centres, form) == _centred(centres, form, K)).all()


def test_windows_begin_where_the_input_does():
    from freqid.frf.local_windows import Form, Lines, _centred, _first

    K, form = 900, Form(3, 3, 97)
    at = np.arange(K)
    U = np.where((at >= 200) & (at < 700), 1.0, 1e-3)[None, None].astype(complex)
    lines = Lines(U, U, at / 10, np.ones(K, bool))
    centres = np.arange(K)
    first = _first(lines, centres, form)
    slack = 2 * form.order + 3
    assert (first[200:240] >= 200 - slack).all()
    assert (first[200:240] <= centres[200:240]).all()
    # elsewhere a window is where it was, as where it would be a good part of what is driven
    others = (centres < 200 - slack) | (centres > 300)
    assert (first == _centred(centres, form, K))[others].all()
    wide = Form(3, 3, 151)
    assert (_first(lines, centres, wide) == _centred(centres, wide, K)).all()
    # a window holds its own line, and none begins before another one
    assert ((first <= centres) & (centres < first + form.width)).all()
    assert (np.diff(first) >= 0).all()
