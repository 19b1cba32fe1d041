"""Excitation: input signals, and the spectra that say where their energy lies.

It may import what stands below it: checks, lti and data.
"""

from freqid.excitation.designs import Design
from freqid.excitation.filters import power_gain
from freqid.excitation.input_spectra import (
    ChirpSpectrum,
    FilteredSpectrum,
    InputSpectrum,
    LineSpectrum,
    WhiteSpectrum,
    below_nyquist,
)
from freqid.excitation.multisines import least_crest, multisine
from freqid.excitation.signal_spectra import (
    MeasuredSpectrum,
    MultisineSpectrum,
    PRBSSpectrum,
    multisine_lines,
)
from freqid.excitation.signals import chirp, prbs, sine, white_noise
