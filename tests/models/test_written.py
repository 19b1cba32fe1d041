"""Models as names and numbers: what cannot be written, or is not there, is said."""

import json
from functools import partial

import numpy as np
import pytest

import freqid as fq
from freqid.checks import InputError
from freqid.lti import BandLimited, InputHolds
from freqid.models.written import hold_of_dict, hold_to_dict, model_of_dict, model_to_dict

NOT_A_FUNCTION = 3


def lag(gain, extra, a):
    """A lag with a gain, and something that changes nothing."""
    return [[-a]], [[gain * a]], [[1.0]], None


def derivative(gain, extra, a):
    return {"a": ([[-1.0]], [[gain]], None, None)}


def through_json(model):
    return json.loads(json.dumps(model_to_dict(model)))


def plant(function=None, **more):
    function = partial(lag, 2.0, (1, 2)) if function is None else function
    return fq.GreyBox(function, [fq.Parameter("a", 3.0)], **more)


def test_a_function_with_arguments_and_derivatives_comes_back():
    own = plant(jacobian=partial(derivative, 2.0, (1, 2)))
    back = model_of_dict(through_json(own))
    assert back.matrices.args == (2.0, (1, 2))
    for a, b in zip(back.state_space(), own.state_space(), strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(back.linearise(back.values, ["a"])[1].A, [[[-1.0]]])


@pytest.mark.parametrize(
    "function",
    [
        lambda a: lag(1.0, None, a),
        partial(lag, gain=1.0, extra=None),
        partial(lag, np.array(1.0), None),
        partial(partial(lag, gain=2.0), extra=None),
    ],
)
def test_what_has_no_path_is_asked_for(function):
    own = plant(function)
    written = through_json(own)
    with pytest.raises(InputError, match=r"no import path.*load\(path, model=plant\)"):
        model_of_dict(written)
    assert model_of_dict(written, own)["a"] == 3.0


def test_a_given_plant_must_be_the_one_that_was_written():
    written = through_json(plant())
    with pytest.raises(InputError, match=r"OutputError is not a GreyBox"):
        model_of_dict(written, fq.OutputError(2))
    with pytest.raises(InputError, match=r"parameters b, a; the file was written of .* with a"):
        model_of_dict(written, fq.first_order())


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("no_such_module:f", "cannot be imported"),
        (f"{__name__}:no_such_function", "cannot be imported"),
        (f"{__name__}:NOT_A_FUNCTION", "is no function"),
    ],
)
def test_a_function_that_is_gone_is_named(path, words):
    written = through_json(plant())
    written["matrices"] = {"function": path}
    with pytest.raises(InputError, match=words) as told:
        model_of_dict(written)
    assert path in str(told.value)


def test_other_kinds_are_refused():
    with pytest.raises(InputError, match="kind='Spline'"):
        model_of_dict({"kind": "Spline"})
    with pytest.raises(InputError, match="cannot be written"):
        model_to_dict(fq.OutputError(2))


@pytest.mark.parametrize(
    "hold",
    [
        fq.ZeroOrderHold(0.01),
        fq.FirstOrderHold(0.02),
        BandLimited(),
        InputHolds((fq.ZeroOrderHold(0.01), BandLimited())),
    ],
)
def test_holds_come_back(hold):
    assert hold_of_dict(json.loads(json.dumps(hold_to_dict(hold)))) == hold


def test_a_hold_that_no_one_knows_is_named():
    with pytest.raises(InputError, match=r"'third'.*zoh"):
        hold_of_dict({"name": "third", "period": 0.1})
