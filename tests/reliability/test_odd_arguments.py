"""Every argument of every public function beside what nobody meant: an error of ours, or none.

The catalogue beside says what each argument cannot be; here no library's error comes through.
"""

import inspect
import warnings

import matplotlib.pyplot as plt
import numpy as np
import pytest

import freqid as fq
from freqid.checks import InputError
from tests.reliability.test_bad_arguments import CASES, EST, FRF, PLANT, RECORD, SPECTRUM, WAVE

ODD = [np.array([1.0, 2.0]), np.array(["a"]), np.array([]), object(), {}, [None], b"x", 10**400]
# what takes seconds each time it is told nothing new, and what is read with a file that is there
SLOW = {"experiment_design", "read", "read_response", "load"}


def functions():
    for name, case in CASES.items():
        if case is None or name in SLOW:
            continue
        works = case[0]
        if "." in name:
            yield pytest.param(getattr(works, name.split(".")[1]), {}, id=name)
        elif isinstance(works, dict):
            yield pytest.param(getattr(fq, name), works, id=name)
    for owner in (RECORD, FRF, EST, PLANT, WAVE, SPECTRUM):
        kind = type(owner)
        for name in dir(kind):
            # pickles and copies are the interpreter's own business
            if not name.startswith("_") and inspect.isfunction(getattr(kind, name)):
                yield pytest.param(getattr(owner, name), {}, id=f"{kind.__name__}.{name}")


@pytest.mark.parametrize(("function", "works"), list(functions()))
def test_no_error_of_a_library_comes_through(function, works, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    warnings.simplefilter("ignore")
    foreign = []
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            continue
        for odd in ODD:
            try:
                function(**{**works, name: odd})
            except (InputError, OSError):
                pass
            except Exception as error:
                missing = isinstance(error, TypeError) and "required positional" in str(error)
                if not missing:
                    foreign.append((name, odd, error))
    plt.close("all")
    assert not foreign
