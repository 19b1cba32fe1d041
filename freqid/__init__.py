"""freqid: physical parameters from chirp experiments, whatever the input did between samples.

Names and their homes stand in ``__init__.pyi``; each is imported when it is first used (SPEC 1).
"""

import importlib
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

__version__ = "0.1.0"

# what pickles of version 0.1.0 name, when every file stood here, and where it lives now
_FORMER = {
    "black_box": "fitting.black_box.output_error", "charts": "fitting.cost.charts",
    "estimate": "fitting.estimate", "experiments": "fitting.cost.experiments",
    "frequency_response": "data.frequency_response", "holds": "lti.holds",
    "input_spectra": "excitation.input_spectra", "matrices": "models.matrices",
    "optimise": "fitting.search.descent", "parameter": "models.parameter",
    "plants": "models.plants", "priors": "fitting.cost.priors",
    "time_experiments": "fitting.cost.time_experiments",
    "rational": "models.output_error", "record": "data.record",
    "responses": "lti.responses", "sampled_plant": "lti.state_space",
    "signal_spectra": "excitation.signal_spectra", "spectra": "frf.spectra",
    "structures": "fitting.cost.structures", "ties": "models.ties",
    "transfer_functions": "models.transfer_function",
}  # fmt: skip


class _FormerModules:
    """Finds modules under their former names; what they no longer hold is an empty class."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        package, _, module = name.rpartition(".")
        known = package == __name__ and module in _FORMER
        return ModuleSpec(name, self) if known else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        home = importlib.import_module(f"{__name__}.{_FORMER[spec.name.rpartition('.')[2]]}")
        former = ModuleType(spec.name)
        vars(former)["__getattr__"] = lambda name: getattr(home, name, type(name, (), {}))
        return former

    def exec_module(self, module: ModuleType) -> None:
        """Nothing: every name is looked up where it lives."""


sys.meta_path.append(_FormerModules())  # type: ignore[arg-type]
