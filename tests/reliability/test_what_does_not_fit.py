"""Arguments that are well formed and do not fit one another: each refusal says what and why."""

import control
import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.checks import InputError

PLANT, DT = fq.first_order(), 5e-3
U = fq.chirp(2, 40, 1.0, DT)
RECORD = fq.simulate(PLANT, U, DT).with_noise(0.01)
TWO = fq.Record(np.column_stack([RECORD.u, RECORD.u]), RECORD.y, DT)
STREAM = fq.open(np.column_stack([RECORD.u, RECORD.y]), dt=DT)
FRF = fq.FrequencyResponse(np.arange(1.0, 20), 1 / (1 + 0.1j * np.arange(1, 20)))
EST = fq.fit(PLANT, RECORD)
LATE = fq.GreyBox(
    lambda b, a: ([[-a]], [[b]], [[1.0]], None),
    [fq.Parameter("b", 45.0), fq.Parameter("a", 22.0)],
    input_delay=0.001,
)
APART = fq.Record(np.column_stack([RECORD.u, np.roll(RECORD.u, 31)]), RECORD.y, DT)
WHITE = fq.WhiteSpectrum()
FRAME = pd.DataFrame({"time": DT * np.arange(len(U)), "u": RECORD.u, "y": RECORD.y})


def model_of(matrices):
    return fq.GreyBox(matrices, [fq.Parameter("a", 1.0)])


def masses(M, B):
    return fq.mechanical(M, lambda k: k * np.eye(2), None, B, parameters=[fq.Parameter("k", 5.0)])


REFUSALS = {
    "a discrete plant for a bias": (
        lambda: fq.apparent_response(control.ss(-0.5, 1, 1, 0, 0.1), WHITE, 0.01, base_dt=5e-3),
        "continuous-time plant",
    ),
    "spectra that are none": (
        lambda: fq.bias_map(PLANT, {"a": 5}, [2], base_dt=DT),
        "spectra['a'] is a int",
    ),
    "a map of a band-limited input without its period": (
        lambda: fq.bias_map(PLANT, {"a": WHITE}, [2], true_hold=fq.BandLimited()),
        "base_dt is missing",
    ),
    "a design beyond the Nyquist limit": (
        lambda: fq.d_optimal_spectrum(PLANT, (1, 400), 1.0, DT),
        "Nyquist limit",
    ),
    "samples without end": (lambda: fq.white_noise(10**12), "take less"),
    "a chirp shorter than a sample": (
        lambda: fq.chirp(1, 2, 1e-4, 1e-3),
        "shorter than half of dt",
    ),
    "powers that are zero": (
        lambda: fq.multisine([1.0, 2.0], 1.0, DT, powers=[0.0, 0.0]),
        "powers are all zero",
    ),
    "rows for columns": (
        lambda: fq.Record(RECORD.u[None], RECORD.y[None], DT),
        "channels of one sample; samples go down",
    ),
    "a list where one name is wanted": (lambda: PLANT.fix(["a", "b"]), "parameter=['a', 'b']"),
    "a function for a model": (
        lambda: fq.fit(fq.first_order, RECORD),
        "model=function is not a model: call it first",
    ),
    "an input without power at some lines": (
        lambda: fq.h1(fq.Record(np.arange(200) % 2.0, RECORD.y[:200], DT), 20),
        "an input has no power at 1 of 10 lines, the first at",
    ),
    "matrices that are not finite": (
        lambda: fq.ZeroOrderHold(1.0).sampled(np.array([[np.nan]]), np.ones((1, 1))),
        "A has entries that are NaN or infinite",
    ),
    "matrices that are complex": (
        lambda: fq.ZeroOrderHold(1.0).sampled(np.array([[1j]]), np.ones((1, 1))),
        "A is complex",
    ),
    "a register too long": (lambda: fq.PRBSSpectrum(30), "at most 24"),
    "a channel that is not there": (lambda: fq.MeasuredSpectrum(RECORD, channel=1), "channel=1"),
    "a difference of unlike records": (lambda: RECORD - RECORD.slice(0, 0.5), "unlike lengths"),
    "a record divided by a text": (lambda: RECORD / "a", "divided by 'a'"),
    "a record divided by zero": (lambda: RECORD / 0, "divided by zero"),
    "a ratio to noise of a constant": (
        lambda: fq.Record(U, np.ones_like(U), DT).with_noise(snr=10),
        "an output is constant",
    ),
    "a trend of too high an order": (
        lambda: fq.Record([0.0, 1, 2], [0.0, 1, 2], DT).detrend(3),
        "order=3",
    ),
    "a stream where samples are wanted": (lambda: fq.compare(EST, STREAM), "Stream is neither"),
    "a reference of a stream": (
        lambda: fq.h1(STREAM, 50, reference=np.zeros(len(U))),
        "a stream has none",
    ),
    "records of unlike channels": (lambda: fq.h1([RECORD, TWO]), "records[1] has 2 inputs"),
    "as many references as records": (
        lambda: fq.h1([RECORD, RECORD], reference=[RECORD.u]),
        "1 signals for 2 records",
    ),
    "a name for a reference": (lambda: fq.h1([RECORD, RECORD], reference="r"), "reference='r'"),
    "h2 of more inputs than outputs": (lambda: fq.h2(APART, 50), "use h1"),
    "a distortion of two inputs": (lambda: fq.distortion(TWO, 0.2), "for several take periodic"),
    "a distortion of one period": (lambda: fq.distortion(RECORD, 0.9), "two are needed"),
    "inputs that move alike": (
        lambda: fq.etfe([TWO, TWO]),
        "the experiments move the inputs alike",
    ),
    "a column of no such name": (
        lambda: fq.Record.from_frame(FRAME, inputs="u", outputs="z"),
        "outputs='z' is not one of",
    ),
    "a page beside several records": (
        lambda: EST.report("page.html", validation=[RECORD]),
        "validation=list is neither a Record",
    ),
    "figures in a folder of no name": (lambda: fq.paper.figures(3), "out=3 must be a path"),
    "a delay between straight lines": (
        lambda: fq.fit(LATE, RECORD, hold="foh"),
        "a delay needs a zero-order hold",
    ),
    "logs without times": (lambda: fq.Record.from_logs(None, U, U, U), "u_time=None"),
    "matrices that are a number": (
        lambda: fq.GreyBox(3, [fq.Parameter("k", 1.0)]),
        "matrices=3 is no function",
    ),
    "a fleet without parameters": (
        lambda: fq.plot_fleet(pd.DataFrame({"a": [1]}), parameter="k"),
        "there are none",
    ),
    "no column at all": (
        lambda: fq.Record.from_frame(FRAME, inputs=[], outputs="y"),
        "names no column",
    ),
    "a grid without a time": (
        lambda: fq.Record.from_frame(FRAME[["u", "y"]], "u", "y", resample=True),
        "needs a column or index called 'time'",
    ),
    "times that are texts": (
        lambda: fq.Record.from_frame(FRAME.assign(time="x"), "u", "y"),
        "holds 'x', which is neither a number nor a time",
    ),
    "two rows on a grid": (
        lambda: fq.Record.from_frame(FRAME[:2], "u", "y", resample=True),
        "three rows or more",
    ),
    "clocks that do not overlap": (
        lambda: fq.Record.from_logs([0.0, 1, 2], [0.0, 1, 2], [5.0, 6, 7], [0.0, 1, 2]),
        "the clocks do not overlap",
    ),
    "two stamps alone": (
        lambda: fq.Record.from_logs([0.0, 1], [0.0, 1], [0.0, 1], [0.0, 1]),
        "three finite times",
    ),
    "a response of time": (lambda: fq.fit(PLANT, FRF, domain="time"), "needs a Record"),
    "a hold for a continuous response": (lambda: fq.fit(PLANT, FRF, hold="zoh"), "give a Hold"),
    "a black box of a continuous response": (
        lambda: fq.fit(fq.OutputError(1), FRF),
        "a sampled model needs a response",
    ),
    "a band without lines": (lambda: FRF.select((500, 900)), "holds no frequency"),
    "an output that is not there": (lambda: FRF.unit(4), "output=4"),
    "entries of weights": (
        lambda: fq.fit(PLANT, [RECORD, RECORD], weights=["noise"]),
        "1 entries for 2 experiments",
    ),
    "a start of no such name": (
        lambda: fq.fit(PLANT, RECORD, start={"q": 1.0}),
        "start='q' is not one of",
    ),
    "robust fits of responses": (lambda: fq.fit(PLANT, FRF, loss="huber"), "needs records"),
    "an offset of responses": (
        lambda: fq.fit(PLANT, FRF, offset="estimate"),
        "offset='estimate' needs records",
    ),
    "separate and fixed": (
        lambda: fq.fit(PLANT.fix("a"), [RECORD, RECORD], separate=["a"]),
        "free it first",
    ),
    "a gear of zero": (lambda: fq.drivetrain(2, gear=0), "gear=0"),
    "masses without end": (lambda: fq.drivetrain(10**6), "at most"),
    "masses that are not symmetric": (
        lambda: masses([[1.0, 0.5], [0.0, 1.0]], [[1.0], [0.0]]),
        "not symmetric",
    ),
    "forces of another size": (lambda: masses(np.eye(2), [[1.0]]), "B has shape"),
    "matrices that are none": (lambda: model_of(lambda a: 5), "expected A, B, C, D"),
    "matrices with rows of unlike length": (
        lambda: model_of(lambda a: ([[1, 2], [3]], [[1], [1]], [[1, 0]], [[0]])),
        "unlike length",
    ),
    "vectors for matrices": (
        lambda: model_of(lambda a: ([1.0], [1.0], [1.0], [0.0])),
        "expected (n, n), (n, inputs)",
    ),
    "bounds that are one number": (lambda: PLANT.with_bounds(a=5), "bounds of a"),
    "conditions of no such name": (
        lambda: PLANT.with_conditions(q=1.0),
        "conditions='q' is not one of",
    ),
    "a hold with too many entries": (
        lambda: PLANT.frequency_response([1.0], hold=["zoh", "foh"]),
        "is not a hold",
    ),
    "an early delay of a system": (
        lambda: fq.drivetrain(2, input_delay=-1.0).to_control(pade=2),
        "no system can be",
    ),
    "a response of control that is none": (
        lambda: fq.FrequencyResponse.from_control(5),
        "FrequencyResponseData",
    ),
    "a response with another number of outputs": (
        lambda: fq.compare(EST, fq.FrequencyResponse([1.0, 2], np.ones((2, 1, 2)))),
        "(2, 1) and the model (1, 1)",
    ),
}


@pytest.mark.parametrize("what", REFUSALS)
def test_it_is_refused_with_its_reason(what):
    call, words = REFUSALS[what]
    with pytest.raises(InputError) as told:
        call()
    text = str(told.value)
    assert words in text
    assert len(text) > 15
