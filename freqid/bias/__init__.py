"""Bias: what an estimate will be, without data; maps of that, and the design of experiments.

It may import checks, lti, data, excitation, models and fitting.
"""

from freqid.bias.apparent import apparent_response
from freqid.bias.asymptotic import asymptotic_fit
from freqid.bias.d_optimal import d_optimal_spectrum
from freqid.bias.design import experiment_design
from freqid.bias.maps import bias_map, hold_label
