"""Models go through pickles whatever their function is, and small."""

import copy
import pickle
import subprocess
import sys
import threading

import numpy as np
import pytest

import freqid as fq


def made_inside(kind):
    gain = 3.0

    def lag(b, a):
        return [[-a]], [[gain * b]], [[1.0]], None

    functions = {
        "lambda": lambda b, a: ([[-a]], [[3.0 * b]], [[1.0]], None),
        "closure": lag,
        "numpy": lambda b, a: (np.array([[-a]]), np.array([[3.0 * b]]), np.eye(1), None),
    }
    return fq.GreyBox(functions[kind], [fq.Parameter("b", 5.0), fq.Parameter("a", 2.0)])


def late(Td=0.02):
    parameters = [fq.Parameter("a", 2.0), fq.Parameter("Td", Td)]
    return fq.GreyBox(lambda a: ([[-a]], [[a]], [[1.0]], None), parameters, input_delay="Td")


def slopes():
    return fq.GreyBox(
        lambda a: ([[-a]], [[1.0]], [[1.0]], None), [fq.Parameter("a", 2.0)],
        jacobian=lambda a: {"a": ([[-1.0]], [[0.0]], [[0.0]], None)},
    )  # fmt: skip


IN_ANOTHER_PROCESS = """
import pickle, sys
thing = pickle.load(sys.stdin.buffer)
model = getattr(thing, "model", thing)
print(repr(model.frequency_response([3.0]).response[0, 0, 0].item()), len(model.parameters))
"""


def elsewhere(thing):
    code = pickle.dumps(thing)
    done = subprocess.run(
        [sys.executable, "-c", IN_ANOTHER_PROCESS], input=code, capture_output=True, check=True
    )
    return done.stdout.decode().split()


@pytest.mark.study
@pytest.mark.parametrize(
    "model",
    [made_inside("lambda"), made_inside("closure"), made_inside("numpy"), late(), slopes(),
     fq.two_mass(), made_inside("lambda").tie(a="2 * b").fix("b")],
)  # fmt: skip
def test_a_model_of_any_function_arrives_in_another_process(model):
    value, count = elsewhere(model)
    assert complex(value) == model.frequency_response([3.0]).response[0, 0, 0]
    assert int(count) == len(model.parameters)
    assert len(pickle.dumps(model)) < 5000
    again = pickle.loads(pickle.dumps(model))
    assert pickle.loads(pickle.dumps(again)).values == model.values
    for one, other in zip(again.state_space(), model.state_space(), strict=True):
        assert np.array_equal(one, other)


def test_an_estimate_of_a_lambda_arrives_and_is_fitted_on():
    model = made_inside("lambda")
    record = fq.simulate(model, fq.white_noise(400, seed=1), 0.05).with_noise(0.01, seed=2)
    est = fq.fit(model, record)
    assert complex(elsewhere(est)[0]) == est.model.frequency_response([3.0]).response[0, 0, 0]
    back = pickle.loads(pickle.dumps(est))
    assert fq.fit(back.model, record)["a"] == pytest.approx(est["a"], rel=1e-6)


def test_copies_call_the_same_function():
    # what cannot be pickled at all can be copied
    lock = threading.Lock()
    model = fq.GreyBox(
        lambda a: ([[-a if lock else 0.0]], [[1.0]], [[1.0]], None), [fq.Parameter("a", 2.0)]
    )
    for other in (copy.copy(model), copy.deepcopy(model)):
        assert other.matrices is model.matrices
        assert other.values == model.values
    with pytest.raises(TypeError, match="pickle"):
        pickle.dumps(model)


SCRIPT = """
import pickle, sys
import freqid as fq
from functools import partial

def lag(gain, b, a):
    return [[-a]], [[gain * b]], [[1.0]], None

model = fq.GreyBox(partial(lag, 3.0), [fq.Parameter("b", 5.0), fq.Parameter("a", 2.0)])
sys.stdout.buffer.write(pickle.dumps(model))
"""


def test_functions_of_a_script_go_along(tmp_path):
    (tmp_path / "mine.py").write_text(SCRIPT)
    made = subprocess.run(
        [sys.executable, "mine.py"], cwd=tmp_path, capture_output=True, check=True
    )
    model = pickle.loads(made.stdout)
    assert model.frequency_response([0.0]).response[0, 0, 0] == pytest.approx(7.5)


def test_a_jacobian_need_not_know_delays():
    model = fq.GreyBox(
        lambda a: ([[-a]], [[a]], [[1.0]], None),
        [fq.Parameter("a", 20.0), fq.Parameter("Td", 0.01)], input_delay="Td",
        jacobian=lambda a: {"a": ([[-1.0]], [[1.0]], [[0.0]], None)},
    )  # fmt: skip
    record = fq.simulate(model, fq.white_noise(600, seed=1), 0.01).with_noise(0.001)
    est = fq.fit(model.with_values(Td=0.013, a=25.0), record)
    assert est["a"] == pytest.approx(20.0, rel=0.02)
