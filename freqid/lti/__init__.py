"""The kernel: holds, state spaces, plants as a hold samples them, resolvents and exact derivatives.

It may import ``freqid.checks`` only.
"""

from freqid.lti.bases import Basis, basis_of, eigenbasis_of_many
from freqid.lti.doubles import in_doubles
from freqid.lti.eigenvectors import eigenvalues_and_derivatives
from freqid.lti.exponential import exponential
from freqid.lti.holds import (
    BandLimited,
    FirstOrderHold,
    Hold,
    InputHolds,
    PeriodicHold,
    Sampled,
    ZeroOrderHold,
    as_hold,
    known_hold,
)
from freqid.lti.observability import observed, reduced
from freqid.lti.polynomials import PolynomialBasis
from freqid.lti.projection import directions, eliminate, solved, triangle, triangle_of
from freqid.lti.quadrature import NODES, TOLERANCE, panel_nodes, resolved, unresolved
from freqid.lti.realisation import Realisation, Timing, sampled_response
from freqid.lti.responses import (
    Plane,
    on_circle,
    points,
    response_and_derivatives,
    transfer,
    transition,
)
from freqid.lti.rounding import VISIBLE, rounding, sentence, warn_of_rounding
from freqid.lti.sampled import sum_runs
from freqid.lti.state_space import Linearisation, StateSpace
from freqid.lti.tuning import keep_freed_memory, tuned
