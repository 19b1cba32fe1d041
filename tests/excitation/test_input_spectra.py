"""Spectra of inputs against the signals that have them, and folding against the FFT."""

import control
import numpy as np
import pytest
import scipy.signal

import freqid as fq
from freqid.data.folding import fold, low_pass_gain, unfold

T1 = 0.5e-3


@pytest.mark.parametrize(
    ("spectrum", "signal"),
    [
        (fq.ChirpSpectrum(10, 80), fq.chirp(10, 80, 50, T1)),
        (fq.ChirpSpectrum(10, 80, "log", 2), fq.chirp(10, 80, 50, T1, method="log", amplitude=2)),
        (fq.WhiteSpectrum(), fq.white_noise(100000, seed=1)),
        (fq.FilteredSpectrum(([0.1], [1, -0.9])),
         scipy.signal.lfilter([0.1], [1, -0.9], fq.white_noise(100000, seed=2))),
        (fq.PRBSSpectrum(9, clock=4), fq.prbs(9, T1, clock=4, periods=8)),
        (fq.MultisineSpectrum((10, 80), 1.0), fq.multisine((10, 80), 1.0, T1, periods=3)),
    ],
)  # fmt: skip
@pytest.mark.parametrize("factor", [1, 3, 10])
def test_power_below_a_frequency_is_that_of_the_signal(spectrum, signal, factor):
    """Cumulated power of the decimated signal's periodogram against densities and lines."""
    kept = signal[::factor]
    f, density = scipy.signal.periodogram(kept, 1 / (T1 * factor), detrend=False)
    df, total = f[1] - f[0], np.mean(signal**2)
    edges = 0.5 / (T1 * factor) * np.array([0.2, 0.5, 0.8, 1.001])
    if len(spectrum.edges(T1)):
        grid = np.linspace(0, 0.5 / (T1 * factor), 20001)
        smooth = spectrum.aliased_density(grid, T1, factor)
    lines, powers = spectrum.aliased_lines(T1, factor)
    for edge in edges:
        expected = powers[lines <= edge].sum()
        if len(spectrum.edges(T1)):
            inside = grid <= edge
            expected += np.trapezoid(smooth[inside], grid[inside])
        assert density[f <= edge].sum() * df == pytest.approx(expected, abs=0.03 * total)


def test_spectra_of_periodic_signals_are_exact():
    n = (2**7 - 1) * 3
    measured = fq.MeasuredSpectrum(fq.Record(fq.prbs(7, T1, clock=3), np.zeros(n), dt=T1))
    f, power = fq.PRBSSpectrum(7, clock=3).lines(T1)
    g, other = measured.lines(T1)
    strong = power > 1e-9 * power.max()
    assert np.allclose(f[strong], g)
    assert np.allclose(power[strong], other)
    flat = fq.multisine((5, 35), 1.0, 1e-3, crest="random", rms=2)
    assert np.allclose(fq.MeasuredSpectrum(fq.Record(flat, flat, dt=1e-3)).lines(1e-3)[1], 4 / 31)


def test_sums_and_multiples():
    total = 2 * fq.ChirpSpectrum(10, 80) + fq.LineSpectrum([5, 30], [1, 2]) + fq.WhiteSpectrum(0.5)
    assert total.power(T1) == pytest.approx(1 + 3 + 0.5)
    assert total.density([20.0], T1)[0] == pytest.approx(1 / 70 + T1)
    frame = total.to_frame(T1, factor=10)
    assert list(frame.columns) == ["frequency", "density", "power"]
    assert frame["frequency"].max() == pytest.approx(100)


def test_filters_of_every_kind_agree():
    b, a = scipy.signal.butter(2, 0.1)
    discrete = control.tf(b, a, T1)
    f = np.linspace(0, 1000, 50)
    by_tuple = fq.FilteredSpectrum((b, a)).density(f, T1)
    assert np.allclose(by_tuple, fq.FilteredSpectrum(discrete).density(f, T1))
    with pytest.raises(ValueError, match=r"dt=0\.0005"):
        fq.FilteredSpectrum(discrete).density(f, 1e-3)
    lag = fq.FilteredSpectrum(control.tf([1], [1, 1]), fq.ChirpSpectrum(0.1, 10))
    assert lag.density([1.0], T1)[0] == pytest.approx(0.5 / 9.9 / (1 + (2 * np.pi) ** 2))


def test_folding_agrees_with_sampling():
    t = T1 * np.arange(4000)
    for f in (30.0, 170.0, 333.0, 990.0):
        kept = np.cos(2 * np.pi * f * t)[::10]
        at, mirrored = fold(f, T1, 10)
        peak = np.argmax(np.abs(np.fft.rfft(kept))) / (400 * 10 * T1)
        assert peak == pytest.approx(at)
        assert np.any(np.isclose(unfold(at, T1, 10), -f if mirrored else f))


def test_the_antialias_filter_has_the_gain_that_it_shows():
    u = np.cos(2 * np.pi * 60 * T1 * np.arange(8000))
    kept = fq.Record(u, u, dt=T1).decimate(10, antialias=True).u[300:500]
    assert np.abs(kept).max() == pytest.approx(low_pass_gain(60, T1, 10), rel=1e-3)


@pytest.mark.parametrize("crest", ["schroeder", "random", "minimise"])
def test_multisines_have_their_lines_and_nothing_else(crest):
    u = fq.multisine((1, 31), 1.0, 1 / 512, periods=2, crest=crest)
    power = np.abs(np.fft.rfft(u) / len(u)) ** 2 * 2
    assert np.allclose(power[2:63:2], 1 / 31)
    assert power.sum() == pytest.approx(1)
    if crest == "minimise":
        assert np.abs(u).max() < 1.45


def test_multisines_of_given_powers():
    share = np.arange(1.0, 32)
    u = fq.multisine((1, 31), 1.0, 1 / 512, powers=share)
    assert np.allclose((2 * np.abs(np.fft.rfft(u) / 512) ** 2)[1:32], share / share.sum())
    assert np.abs(u).max() < 1.6


def test_prbs_has_a_flat_autocorrelation():
    u = fq.prbs(6, T1)
    correlation = np.fft.irfft(np.abs(np.fft.rfft(u)) ** 2, 63)
    assert np.allclose(correlation, [63, *[-1] * 62])


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: fq.LineSpectrum([], []), "at least one"),
        (lambda: fq.LineSpectrum([1, 2], [1, -1]), "not negative"),
        (lambda: fq.LineSpectrum([1, 2], [0, 0]), "above zero"),
        (lambda: fq.LineSpectrum([1, 1], [1, 1]), "all different"),
        (lambda: fq.ChirpSpectrum(80, 10), "below high"),
        (lambda: -1 * fq.WhiteSpectrum(), "factor=-1"),
        (lambda: fq.ChirpSpectrum(10, 80).density([1.0], 0.01), "Nyquist"),
        (lambda: fq.multisine((10.2, 10.4), 1.0, T1), "lengthen the period"),
        (lambda: fq.multisine((10, 2000), 1.0, T1), "Nyquist"),
        (lambda: fq.multisine((10, 80), 1.00013, T1), "whole number"),
        (lambda: fq.multisine((10, 80), 1.0, T1, powers=[1, 2]), "71 powers"),
        (lambda: fq.prbs(40, T1), "at most 24"),
        (lambda: fq.FilteredSpectrum("low pass").density([1.0], T1), "no filter"),
        (lambda: fq.MeasuredSpectrum(fq.Record(np.zeros(9), np.ones(9), dt=T1)), "zero"),
    ],
)
def test_bad_input(make, match):
    with pytest.raises(ValueError, match=match):
        make()
