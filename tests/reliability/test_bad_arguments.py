"""A catalogue: every public function, each argument, what it cannot be; all before work begins."""

import inspect
import math

import numpy as np
import pandas as pd
import pytest

import freqid as fq
from freqid.checks import InputError

NAN, INF = math.nan, math.inf
# what an argument of each kind cannot be
KINDS = {
    "scale": ["a", NAN, INF, 10**400, [1.0, 2.0, 3.0], {"w": 1.0}, 1j, object()],
    "number": ["a", NAN, INF, 10**400, [1.0, 2.0], 1j, object()],
    "probability": ["a", NAN, 0, 1, 2, -1, [0.1], 1j],
    "positive": ["a", NAN, INF, 10**400, 0, -1, [1.0, 2.0]],
    "not negative": ["a", NAN, INF, -1, [1.0, 2.0]],
    "window": ["nonsense", "", ["a"]],
    "prior": [5, (1, 0), ("a", "b"), (1,)],
    "count": [np.array("a"), "a", 2.5, -1, NAN, 10**400, [1]],
    "choice": ["nonsense", 5, "", ["no"]],
    "band": ["a", (9, 1), (NAN, 3), (1,), 5, (1, 2, 3), ("a", "b")],
    "record": [np.array("a"), 5, "x", None, [], {}, [5]],
    "response": [5, "x", None, [1.0]],
    "estimate": [5, "x", None, [1.0]],
    "model": [5, "x", None, [1.0], object()],
    "plant": [5, "x", None, [1.0], object()],
    "path": [5, None, 3.5, ["a"], "a\0b"],
    "names": [5, [1, 2], ["a", "a", "a", "a"]],
    "mapping": [5, [1], "a"],
    "table": [5, None, "x", [1.0]],
    "seed": ["a", -1, 0.5, NAN],
    "hold": [5, "nonsense", [1], object],
    "samples": ["a", [], [[[1.0]]], [1.0, NAN], [1.0, 10**400], [[1.0], [1.0, 2.0]], [1j], None],
    "spectrum": [5, "x", None, object()],
    "filter": [5, "x", None],
    "not a source": [5, None],
    "function": [5, "x", None],
    "parameters": [5, ["k"], [5], "k"],
    "frequencies": ["a", [1.0, NAN], [[1.0, 2.0]], [2.0, 1.0], [1.0, 1.0]],
    "whole numbers": ["a", ["a"], [2.5], [-1]],
    "iterable": [np.array("a"), 5, [], ["a"], [2.5], [-1]],
    "text": [5, "", None, ["a"]],
    "bound": ["a", NAN, (1, 2)],
    "pair": [5, (3, 1), ("a", "b"), (1,)],
    "delay": ["nonsense", ["no"], NAN, object()],
    "optional path": [5, 3.5, ["a"], "a\0b"],
    "weights": ["x", [1.0], [-1.0] * 7, object()],
}

PLANT = fq.first_order()
RECORD = fq.simulate(PLANT, fq.chirp(2, 40, 1.0, 5e-3), 5e-3).with_noise(0.01)
WAVE = fq.simulate(PLANT, fq.multisine((1, 40), 0.5, 5e-3, 4, crest="schroeder"), 5e-3)
FLEET = pd.DataFrame({"k": np.arange(5.0), "k_std": 1.0})
STREAM = fq.open(np.column_stack([RECORD.u, RECORD.y]), dt=RECORD.dt)
FRF = fq.h1([RECORD, RECORD.with_noise(0.01, seed=2)])
EST = fq.fit(PLANT, RECORD)
SPECTRUM = fq.ChirpSpectrum(2, 40)
MAP = fq.bias_map(PLANT, {"2-40": SPECTRUM}, [2], ["zoh"], 5e-3)

# name: (what works, the kinds of the arguments that are tried)
# fmt: off
CASES = {
    "Record": (
        dict(u=[0.0, 1], y=[0.0, 1], dt=0.1),
        "u y reference: samples; dt input_dt: positive; hold: hold; input_names output_names: "
        "names; units conditions: mapping"
    ),
    "FrequencyResponse": (
        dict(frequency=[1.0, 2.0], response=[1.0, 2.0]),
        "frequency: frequencies; dt: number; variance coherence: weights; input_names "
        "output_names: names; reach: count; conditions: mapping"
    ),
    "PeriodicResponse": (
        dict(frequency=[1.0], response=[1.0], inputs=[[[1.0]]], outputs=[[[1.0]]],
            noise=[[np.eye(2)]], freedom=3),
        "frequency: frequencies; freedom: count"
    ),
    "Parameter": (
        dict(name="k", value=1.0),
        "name: text; value: number; lower upper: bound; physical: pair; prior: prior"
    ),
    "GreyBox": (
        dict(matrices=PLANT.matrices, parameters=PLANT.parameters),
        "matrices: function; parameters: parameters; outputs inputs: names; ties conditions: "
        "mapping; input_delay: delay"
    ),
    "OutputError": (dict(order=1), "order: count"),
    "TransferFunction": (dict(zeros=1, poles=2), "zeros poles: count; delay: delay"),
    "mechanical": (
        dict(M=[[1.0]], K=lambda k: [[k]], parameters=[fq.Parameter("k", 1.0)]),
        "measured: choice; parameters: parameters; conditions: mapping"
    ),
    "drivetrain": (dict(n_masses=2), "n_masses: count; gear: number; outputs: names"),
    "two_mass": (dict(), "k gear: number"),
    "first_order": (dict(), "a b: number"),
    "simulate": (
        dict(model=PLANT, u=[0.0, 1], dt=0.1),
        "model: model; u: samples; dt: positive; hold: hold; input_names: names"
    ),
    "Design": (
        dict(u=[0.0, 1], dt=0.1),
        "u: samples; dt: positive; input_names: names; units: mapping"
    ),
    "Design.within": (fq.Design([0.0, 1], 0.1), "amplitude slew: positive"),
    "Design.to_csv": (fq.Design([0.0, 1], 0.1), "path: path"),
    "ZeroOrderHold": (dict(period=0.1), "period: positive"),
    "FirstOrderHold": (dict(period=0.1), "period: positive"),
    "BandLimited": (dict(), ""),
    "chirp": (
        dict(f0=1, f1=4, duration=1, dt=0.1),
        "f0 f1 duration dt: positive; method: choice; phase amplitude: number"
    ),
    "sine": (
        dict(frequency=1, duration=1, dt=0.1),
        "frequency duration dt: positive; phase amplitude: number"
    ),
    "multisine": (
        dict(band=(1, 5), period=1.0, dt=0.05, crest="schroeder"),
        "band: band; period dt rms: positive; periods n_inputs: count; crest grid: choice; seed: "
        "seed; powers: weights"
    ),
    "prbs": (dict(n_bits=3, dt=0.1), "n_bits clock periods: count; dt: positive"),
    "white_noise": (dict(n=5), "n: count; seed: seed"),
    "ChirpSpectrum": (dict(low=1, high=2), "low high amplitude: positive; method: choice"),
    "LineSpectrum": (
        dict(frequencies=[1.0], powers=[1.0]),
        "frequencies: frequencies; powers: samples"
    ),
    "FilteredSpectrum": (dict(system=([1.0], [1.0, 0.5])), "system: filter"),
    "MeasuredSpectrum": (dict(record=RECORD), "record: record; channel: count"),
    "MultisineSpectrum": (dict(band=(1, 5), period=1.0), "band: band; period power: positive"),
    "PRBSSpectrum": (dict(n_bits=5), "n_bits clock: count; amplitude: positive"),
    "WhiteSpectrum": (dict(), "variance: positive"),
    "etfe": (dict(record=RECORD), "record: record; band: band"),
    "h1": (
        dict(records=RECORD, segment=50),
        "records: record; segment: count; band: band; window: window; overlap: not negative; "
        "detrend: choice"
    ),
    "h2": (
        dict(records=RECORD, segment=50),
        "records: record; segment: count; band: band; window: window"
    ),
    "hv": (
        dict(records=RECORD, segment=50),
        "records: record; segment: count; band: band; window: window"
    ),
    "cross_spectra": (
        dict(records=RECORD, segment=50),
        "records: record; segment: count; band: band; window: window; overlap: not negative; "
        "detrend: choice"
    ),
    "local_polynomial": (dict(records=RECORD), "records: record; order width: count; band: band"),
    "local_rational": (dict(records=RECORD), "records: record; order width: count; band: band"),
    "periodic": (
        dict(records=WAVE, period=0.5),
        "records: record; period: positive; skip: count; band: band"
    ),
    "distortion": (
        dict(records=WAVE, period=0.5),
        "records: record; period: positive; skip: count; band: band"
    ),
    "fit": (
        dict(model=PLANT, data=RECORD),
        "model: model; data: record; hold: hold; band: band; weights: weights; initial_state "
        "domain reference offset loss error separate: choice; start: mapping; n_starts: count; "
        "seed: seed"
    ),
    "fit_many": (
        dict(model=PLANT, records=[RECORD]),
        "model: model; records: not a source; path: optional path; chunk: count; reading: mapping"
    ),
    "select_order": (
        dict(data=RECORD, orders=[1]),
        "data: record; orders delays: whole numbers; hold: hold; band: band; initial_state "
        "criterion feedthrough: choice"
    ),
    "load": (dict(path="a.json"), "path: path"),
    "Estimate": None,
    "read": (dict(path="a.csv"), "path: path"),
    "read_response": (dict(path="a.csv"), "path: path"),
    "write": (dict(record=RECORD, path="a.csv"), "record: record; path: path"),
    "open": (
        dict(source=np.zeros((9, 2)), dt=0.1),
        "source: not a source; dt: positive; hold: hold; inputs outputs: names; block: count; "
        "scale: scale"
    ),
    "channels": (dict(path="a.csv"), "path: path"),
    "check_record": (dict(record=RECORD), "record: record"),
    "compare": (
        dict(model=EST, record=RECORD),
        "model: model; record: record; hold: hold; initial_state: choice; band: band"
    ),
    "residual_test": (
        dict(model=EST, record=RECORD),
        "model: model; record: record; lags: count; hold: hold; band: band"
    ),
    "cost_test": (dict(est=EST), "est: estimate"),
    "hold_bias": (
        dict(est=EST, data=RECORD),
        "est: estimate; data: record; band: band; weights: weights"
    ),
    "bootstrap": (
        dict(model=PLANT, records=[RECORD, RECORD]),
        "model: model; records: record; n: count; seed: seed"
    ),
    "cross_validate": (
        dict(model=PLANT, records=[RECORD, RECORD]),
        "model: model; records: record"
    ),
    "apparent_response": (
        dict(plant=PLANT, spectrum=SPECTRUM, dt=0.01),
        "plant: model; spectrum: spectrum; dt base_dt: positive; true_hold: hold; frequency: "
        "samples"
    ),
    "asymptotic_fit": (
        dict(plant=PLANT, spectrum=SPECTRUM, dt=0.01),
        "plant: plant; spectrum: spectrum; dt base_dt: positive; hold true_hold: hold; band: "
        "band; noise_std: not negative; start: mapping; n_starts: count; seed: seed"
    ),
    "bias_map": (
        dict(plant=PLANT, spectra={"a": SPECTRUM}, factors=[2], base_dt=0.005),
        "plant: plant; spectra: mapping; factors: iterable; base_dt: positive; true_hold: hold; "
        "band: band; chunk: count; path: optional path"
    ),
    "experiment_design": (
        dict(plant=PLANT, base_dt=0.005, noise_std=0.1),
        "plant: plant; base_dt amplitude duration: positive; noise_std: not negative; factors: "
        "iterable; true_hold: hold; method criterion: choice; bands: mapping"
    ),
    "d_optimal_spectrum": (
        dict(plant=PLANT, band=(1, 40), period=1.0, dt=0.005),
        "plant: plant; band: band; period dt power: positive"
    ),
    "InputSpectrum": None,
    "bode": (None, "response: response"),
    "nyquist": (None, "response: response"),
    "plot_response": (None, "response: response"),
    "plot_poles": (None, "estimate: estimate"),
    "plot_record": (dict(record=RECORD), "record: record"),
    "plot_spectrogram": (dict(record=RECORD), "record: record; segment: count; channel: choice"),
    "plot_coherence": (dict(frf=FRF), "frf: response; unit: choice"),
    "plot_parameters": (dict(est=EST), "est: estimate"),
    "plot_residuals": (dict(table=None), "table: table"),
    "plot_orders": (dict(table=None), "table: table"),
    "plot_design": (dict(table=None), "table: table"),
    "fleet_alarms": (
        dict(table=FLEET, parameter="k"),
        "table: table; parameter by machine: choice; level: probability"
    ),
    "plot_fleet": (dict(table=None, parameter="a"), "table: table"),
    "plot_bias_map": (dict(table=MAP, parameter="a"), "table: table; parameter: choice"),
    "plot_bias_curves": (dict(table=MAP), "table: table; factor: count"),
    "plot_bias": (
        dict(plant=PLANT, spectrum=SPECTRUM, dt=0.01),
        "plant: plant; spectrum: spectrum; dt: positive; hold: hold"
    ),
    "Record.decimate": (RECORD, "factor: count"),
    "Record.slice": (RECORD, "start stop: number"),
    "Record.detrend": (RECORD, "order: count"),
    "Record.with_noise": (RECORD, "std: samples; snr: number"),
    "Record.with_hold": (RECORD, "hold: hold"),
    "Record.select": (RECORD, "inputs outputs: names"),
    "Stream.decimate": (STREAM, "factor: count"),
    "Stream.slice": (STREAM, "start stop: number"),
    "Stream.select": (STREAM, "inputs outputs: names"),
    "Stream.with_hold": (STREAM, "hold: hold"),
    "Stream.with_band": (STREAM, "band: band"),
    "Stream.load": (STREAM, "stop: count"),
    "FrequencyResponse.select": (FRF, "band: band"),
    "GreyBox.frequency_response": (PLANT, "omega: samples"),
    "Estimate.save": (EST, "path: path"),
    "Estimate.report": (EST, "path: path"),
    "Estimate.frequency_response": (EST, "omega: samples; hold: hold"),
}
# fmt: on


def tried(kinds):
    """Arguments and their kinds: ``"u y: samples; dt: positive"``."""
    for part in filter(None, kinds.split("; ")):
        arguments, kind = part.split(": ")
        for argument in arguments.split():
            yield argument, kind


def entries():
    for name, case in CASES.items():
        if case is None:
            continue
        works, kinds = case
        for argument, kind in tried(kinds):
            for i, bad in enumerate(KINDS[kind]):
                # a default is no mistake
                function = (
                    getattr(fq, name) if "." not in name else getattr(works, name.split(".")[1])
                )
                known = inspect.signature(function).parameters.get(argument)
                if known is not None and (
                    (bad is None and known.default is None) or (isinstance(bad, list) and not bad)
                ):
                    continue
                yield pytest.param(name, works, argument, bad, id=f"{name}-{argument}-{kind}{i}")


@pytest.mark.parametrize(("name", "works", "argument", "bad"), list(entries()))
def test_refused(name, works, argument, bad, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if works is None:
        call = lambda: getattr(fq, name)(bad)  # noqa: E731
    elif "." in name:
        call = lambda: getattr(works, name.split(".")[1])(**{argument: bad})  # noqa: E731
    else:
        call = lambda: getattr(fq, name)(**{**works, argument: bad})  # noqa: E731
    with pytest.raises(InputError) as error:
        call()
    assert len(str(error.value)) > 10
    assert not list(tmp_path.iterdir())


def test_the_catalogue_is_whole():
    public = {n for n in dir(fq) if not n.startswith("_") and callable(getattr(fq, n))}
    assert public == {n for n in CASES if "." not in n}
    assert len(list(entries())) >= 400
