"""Models: what answers as one, grey boxes and plants, black boxes, and their simulation.

It may import checks, lti and data.
"""

from freqid.models.conversion import ModelLike, SystemModel, as_model
from freqid.models.grey_box import GreyBox
from freqid.models.mechanics import mechanical
from freqid.models.model import Model
from freqid.models.observed_order import observed_order
from freqid.models.output_error import DiscreteModel, OutputError, coefficients_of, invert_hold
from freqid.models.parameter import Parameter
from freqid.models.plants import PLANTS, drivetrain, first_order, two_mass
from freqid.models.simulation import (
    FreeMotion,
    forcing,
    late_sampled,
    late_samples,
    later,
    propagate,
    simulate,
)
from freqid.models.transfer_function import (
    ContinuousModel,
    TransferFunction,
    chained,
    coefficients,
    polynomials,
    rational_model,
)
from freqid.models.wrapped import wrapped
from freqid.models.written import (
    hold_of_dict,
    hold_to_dict,
    model_of_dict,
    model_to_dict,
)
