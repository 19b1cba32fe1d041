"""Bias: what an estimate will be, without data; maps of that, and the design of experiments.

It may import checks, lti, data, excitation, models and fitting.
"""

from freqid.bias.apparent import apparent_response
from freqid.bias.asymptotic import asymptotic_fit
from freqid.bias.design import d_optimal_spectrum, experiment_design
from freqid.bias.maps import bias_map, hold_label
