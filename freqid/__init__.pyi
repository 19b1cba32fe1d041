from . import (
    bias as bias,
    cli as cli,
    data as data,
    excitation as excitation,
    fitting as fitting,
    frf as frf,
    lti as lti,
    models as models,
    pages as pages,
    paper as paper,
    plots as plots,
    validation as validation,
)
from .bias.apparent import apparent_response as apparent_response
from .bias.asymptotic import asymptotic_fit as asymptotic_fit
from .bias.design import (
    d_optimal_spectrum as d_optimal_spectrum,
    experiment_design as experiment_design,
)
from .bias.maps import bias_map as bias_map
from .data.files import read as read, write as write
from .data.frequency_response import FrequencyResponse as FrequencyResponse
from .data.quality import check_record as check_record
from .data.record import Record as Record
from .excitation.input_spectra import (
    ChirpSpectrum as ChirpSpectrum,
    FilteredSpectrum as FilteredSpectrum,
    InputSpectrum as InputSpectrum,
    LineSpectrum as LineSpectrum,
    WhiteSpectrum as WhiteSpectrum,
)
from .excitation.multisines import multisine as multisine
from .excitation.signal_spectra import (
    MeasuredSpectrum as MeasuredSpectrum,
    MultisineSpectrum as MultisineSpectrum,
    PRBSSpectrum as PRBSSpectrum,
)
from .excitation.signals import (
    chirp as chirp,
    prbs as prbs,
    sine as sine,
    white_noise as white_noise,
)
from .fitting.entry import fit as fit
from .fitting.estimate import Estimate as Estimate
from .fitting.order_selection import select_order as select_order
from .frf.averaged import h1 as h1, h2 as h2, hv as hv
from .frf.empirical import etfe as etfe
from .frf.local_models import local_polynomial as local_polynomial, local_rational as local_rational
from .frf.periodic import distortion as distortion
from .lti.holds import (
    BandLimited as BandLimited,
    FirstOrderHold as FirstOrderHold,
    ZeroOrderHold as ZeroOrderHold,
)
from .models.grey_box import GreyBox as GreyBox
from .models.output_error import OutputError as OutputError
from .models.parameter import Parameter as Parameter
from .models.plants import (
    drivetrain as drivetrain,
    first_order as first_order,
    two_mass as two_mass,
)
from .models.simulation import simulate as simulate
from .models.transfer_function import TransferFunction as TransferFunction
from .plots.bias_plots import (
    plot_bias as plot_bias,
    plot_bias_curves as plot_bias_curves,
    plot_bias_map as plot_bias_map,
)
from .plots.bode_nyquist import (
    bode as bode,
    nyquist as nyquist,
    plot_coherence as plot_coherence,
    plot_record as plot_record,
)
from .plots.design_plots import plot_design as plot_design
from .plots.estimate_plots import (
    plot_parameters as plot_parameters,
    plot_poles as plot_poles,
    plot_response as plot_response,
    plot_spectrogram as plot_spectrogram,
)
from .plots.validation_plots import plot_orders as plot_orders, plot_residuals as plot_residuals
from .validation.comparison import compare as compare
from .validation.repeats import (
    bootstrap as bootstrap,
    cross_validate as cross_validate,
    hold_bias as hold_bias,
)
from .validation.residual_tests import cost_test as cost_test, residual_test as residual_test

__version__: str
