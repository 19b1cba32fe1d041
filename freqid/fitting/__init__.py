"""Fits: ``fit`` and ``Estimate``, and everything from a data set to a minimum with its covariance.

It may import checks, lti, data, excitation, models and frf; inside, ``cost`` stands below
``search``, ``uncertainty``, readings, estimates, ``black_box`` and ``entry``, in that order.
"""

from freqid.fitting.channel_order import in_order_of
from freqid.fitting.cost.objective import Objective
from freqid.fitting.cost.structures import GreyStructure
from freqid.fitting.digits import in_digits, of_error, rounded
from freqid.fitting.entry import fit
from freqid.fitting.estimate import Z95, Estimate
from freqid.fitting.findings import FOLDED, Finding, Severity
from freqid.fitting.fit_options import check_options, known_options
from freqid.fitting.fitters import FITTERS, Near, SearchOptions, fitter_of
from freqid.fitting.grades import Verdict
from freqid.fitting.grey_box import fit_grey_box
from freqid.fitting.kept import load
from freqid.fitting.many import TableStore, fit_many, made_by_a_store
from freqid.fitting.met import data_digest, met, offset_is_free, remembered
from freqid.fitting.noise_models import GivenWeights, Weights
from freqid.fitting.order_selection import select_order
from freqid.fitting.reading import Reading
from freqid.fitting.reading_sets import read_for
from freqid.fitting.residuals import errors_at_stamps, errors_in_time, line_errors
from freqid.fitting.search.batched import Answers, descend
from freqid.fitting.search.descent import settled
from freqid.fitting.search.interrupted import uninterrupted
from freqid.fitting.signs import Evidence, findings
from freqid.fitting.uncertainty.covariance import determined
from freqid.fitting.uncertainty.minimum import Minimum, Spread
