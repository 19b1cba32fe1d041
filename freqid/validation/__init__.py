"""Validation: a model beside a record, what it leaves tested, and the same fit once more.

It may import checks, lti, data, models and fitting.
"""

from freqid.validation.changes import LEVEL, fleet_alarms
from freqid.validation.comparison import Comparison, compare
from freqid.validation.cost_tests import cost_test
from freqid.validation.fleet_rows import FEWEST, check_columns, fitted_rows, places_of
from freqid.validation.repeats import bootstrap, cross_validate, hold_bias
from freqid.validation.residual_tests import residual_test
