"""Holds: what the input did between its samples. Each file of this folder is one, or their base.

It may import ``freqid.checks`` only.
"""

import importlib
import pkgutil

from freqid.lti.holds.band_limited import BandLimited
from freqid.lti.holds.first_order_hold import FirstOrderHold
from freqid.lti.holds.hold import Hold, ModalSampled, PeriodicHold, Sampled, as_hold, known_hold
from freqid.lti.holds.input_holds import InputHolds
from freqid.lti.holds.phi import phi_functions
from freqid.lti.holds.zero_order_hold import ZeroOrderHold

# every file here is read, so that a new hold needs no line elsewhere to be known by its name
for _file in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_file.name}")

__all__ = [
    "BandLimited",
    "FirstOrderHold",
    "Hold",
    "InputHolds",
    "ModalSampled",
    "PeriodicHold",
    "Sampled",
    "ZeroOrderHold",
    "as_hold",
    "known_hold",
    "phi_functions",
]
