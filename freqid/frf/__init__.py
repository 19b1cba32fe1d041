"""Responses estimated without a model: ratios of DFTs, averages, local models, periodic data.

It may import what stands below it: checks, lti, data, excitation and models.
"""

from freqid.frf.averaged import h1, h2, hv
from freqid.frf.distortions import distortion
from freqid.frf.empirical import etfe
from freqid.frf.local_models import local_polynomial, local_rational
from freqid.frf.means import periodic
from freqid.frf.one_pass import stretches
from freqid.frf.spectra import Spectra, lines_of, spectra
from freqid.frf.welch import CrossSpectra, cross_spectra
