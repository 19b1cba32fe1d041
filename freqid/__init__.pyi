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
from .bias import (
    apparent_response as apparent_response,
    asymptotic_fit as asymptotic_fit,
    bias_map as bias_map,
    d_optimal_spectrum as d_optimal_spectrum,
    experiment_design as experiment_design,
)
from .data import (
    FrequencyResponse as FrequencyResponse,
    PeriodicResponse as PeriodicResponse,
    Record as Record,
    channels as channels,
    check_record as check_record,
    open as open,
    read as read,
    read_response as read_response,
    write as write,
)
from .excitation import (
    ChirpSpectrum as ChirpSpectrum,
    Design as Design,
    FilteredSpectrum as FilteredSpectrum,
    InputSpectrum as InputSpectrum,
    LineSpectrum as LineSpectrum,
    MeasuredSpectrum as MeasuredSpectrum,
    MultisineSpectrum as MultisineSpectrum,
    PRBSSpectrum as PRBSSpectrum,
    WhiteSpectrum as WhiteSpectrum,
    chirp as chirp,
    multisine as multisine,
    prbs as prbs,
    sine as sine,
    white_noise as white_noise,
)
from .fitting import (
    Estimate as Estimate,
    fit as fit,
    fit_many as fit_many,
    load as load,
    select_order as select_order,
)
from .frf import (
    cross_spectra as cross_spectra,
    distortion as distortion,
    etfe as etfe,
    h1 as h1,
    h2 as h2,
    hv as hv,
    local_polynomial as local_polynomial,
    local_rational as local_rational,
    periodic as periodic,
)
from .lti import (
    BandLimited as BandLimited,
    FirstOrderHold as FirstOrderHold,
    ZeroOrderHold as ZeroOrderHold,
)
from .models import (
    GreyBox as GreyBox,
    OutputError as OutputError,
    Parameter as Parameter,
    TransferFunction as TransferFunction,
    drivetrain as drivetrain,
    first_order as first_order,
    mechanical as mechanical,
    simulate as simulate,
    two_mass as two_mass,
)
from .plots import (
    bode as bode,
    nyquist as nyquist,
    plot_bias as plot_bias,
    plot_bias_curves as plot_bias_curves,
    plot_bias_map as plot_bias_map,
    plot_coherence as plot_coherence,
    plot_design as plot_design,
    plot_fleet as plot_fleet,
    plot_orders as plot_orders,
    plot_parameters as plot_parameters,
    plot_poles as plot_poles,
    plot_record as plot_record,
    plot_residuals as plot_residuals,
    plot_response as plot_response,
    plot_spectrogram as plot_spectrogram,
)
from .validation import (
    bootstrap as bootstrap,
    compare as compare,
    cost_test as cost_test,
    cross_validate as cross_validate,
    fleet_alarms as fleet_alarms,
    hold_bias as hold_bias,
    residual_test as residual_test,
)

__version__: str
