"""freqid: physical parameters from chirp experiments, whatever the input did between samples.

Names and their homes stand in ``__init__.pyi``; each is imported when it is first used (SPEC 1).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

__version__ = "0.1.0"
