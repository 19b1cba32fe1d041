"""What else could be in the data: score tests of everything a model may lack, from one fit.

A new suspect is one function in a file of this package, marked with ``@suspect``.
"""

from freqid.fitting.suspects.inquiry import Inquiry
from freqid.fitting.suspects.uneven_outputs import asked_of
