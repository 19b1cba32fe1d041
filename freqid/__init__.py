"""freqid: physical parameters from chirp experiments, whatever the input did between samples."""

from freqid import paper
from freqid.apparent import apparent_response
from freqid.asymptotic import asymptotic_fit
from freqid.averaged import h1, h2, hv
from freqid.bias_map import bias_map
from freqid.bias_plots import plot_bias, plot_bias_curves, plot_bias_map
from freqid.design import d_optimal_spectrum, experiment_design
from freqid.design_plots import plot_design
from freqid.distortion import distortion
from freqid.estimate import Estimate
from freqid.estimate_plots import (
    plot_parameters,
    plot_poles,
    plot_response,
    plot_spectrogram,
)
from freqid.estimators import etfe
from freqid.excitation import chirp, prbs, sine, white_noise
from freqid.files import read, write
from freqid.fit import fit
from freqid.frequency_response import FrequencyResponse
from freqid.holds import BandLimited, FirstOrderHold, ZeroOrderHold
from freqid.input_spectra import (
    ChirpSpectrum,
    FilteredSpectrum,
    InputSpectrum,
    LineSpectrum,
    WhiteSpectrum,
)
from freqid.local_models import local_polynomial, local_rational
from freqid.models import GreyBox
from freqid.multisines import multisine
from freqid.order_selection import plot_orders, select_order
from freqid.parameter import Parameter
from freqid.plants import drivetrain, first_order, two_mass
from freqid.plots import bode, nyquist, plot_coherence, plot_record
from freqid.quality import check_record
from freqid.rational import OutputError
from freqid.record import Record
from freqid.signal_spectra import MeasuredSpectrum, MultisineSpectrum, PRBSSpectrum
from freqid.simulation import simulate
from freqid.transfer_functions import TransferFunction
from freqid.validation import (
    bootstrap,
    compare,
    cost_test,
    cross_validate,
    hold_bias,
    residual_test,
)
from freqid.validation_plots import plot_residuals

__version__ = "0.1.0"

__all__ = [
    "BandLimited",
    "ChirpSpectrum",
    "Estimate",
    "FilteredSpectrum",
    "FirstOrderHold",
    "FrequencyResponse",
    "GreyBox",
    "InputSpectrum",
    "LineSpectrum",
    "MeasuredSpectrum",
    "MultisineSpectrum",
    "OutputError",
    "PRBSSpectrum",
    "Parameter",
    "Record",
    "TransferFunction",
    "WhiteSpectrum",
    "ZeroOrderHold",
    "apparent_response",
    "asymptotic_fit",
    "bias_map",
    "bode",
    "bootstrap",
    "check_record",
    "chirp",
    "compare",
    "cost_test",
    "cross_validate",
    "d_optimal_spectrum",
    "distortion",
    "drivetrain",
    "etfe",
    "experiment_design",
    "first_order",
    "fit",
    "h1",
    "h2",
    "hold_bias",
    "hv",
    "local_polynomial",
    "local_rational",
    "multisine",
    "nyquist",
    "paper",
    "plot_bias",
    "plot_bias_curves",
    "plot_bias_map",
    "plot_coherence",
    "plot_design",
    "plot_orders",
    "plot_parameters",
    "plot_poles",
    "plot_record",
    "plot_residuals",
    "plot_response",
    "plot_spectrogram",
    "prbs",
    "read",
    "residual_test",
    "select_order",
    "simulate",
    "sine",
    "two_mass",
    "white_noise",
    "write",
]
