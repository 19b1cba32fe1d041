"""Pictures with matplotlib; what they draw is computed apart, so that plotly can draw it too.

It may import all packages but ``paper``, ``pages`` and ``cli``.
"""

from freqid.plots.bias_plots import plot_bias, plot_bias_curves, plot_bias_map
from freqid.plots.bode_plots import bode, hold_in_words
from freqid.plots.curves import Shown, amplitude_label, bode_curve, resonances, unit_of
from freqid.plots.design_plots import plot_design
from freqid.plots.estimate_plots import plot_parameters, plot_poles, plot_response, plot_spectrogram
from freqid.plots.fleet_plots import plot_fleet
from freqid.plots.nyquist_plots import nyquist
from freqid.plots.plotly_backend import Part, bode_axes, bode_traces, trace
from freqid.plots.signal_plots import plot_coherence, plot_record
from freqid.plots.sketches import two_mass_sketch
from freqid.plots.spectra import envelope, peaks, worst_stretch
from freqid.plots.style import COLOURS, Panels, Style, context, line
from freqid.plots.validation_plots import plot_comparison, plot_orders, plot_residuals
