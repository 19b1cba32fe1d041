"""A report's recipe runs as it stands, and gives the same numbers."""

import dataclasses
import html
import re
import subprocess
import sys

import numpy as np
import pytest

import freqid as fq
from freqid.data import in_python


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("recipe") / "axis.csv"
    u = fq.chirp(10, 80, 4, 1e-3)
    record = fq.simulate(fq.two_mass(), u, 1e-3).with_noise(0.05)
    path.write_text(record.to_frame().to_csv(sep=";", decimal=","))
    return path


def lines(est, tmp_path):
    est.report(tmp_path / "axis.html")
    page = (tmp_path / "axis.html").read_text(encoding="utf-8")
    return html.unescape(re.search(r'<pre id="call">(.*?)</pre>', page, re.S)[1])


def again(code, folder):
    """The parameters that the lines print in a process of their own."""
    code += "\nprint(*est.values.tolist(), sep='\\n')\n"
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True
    )
    return np.array(run.stdout.split(), dtype=float)


OWN = """
import freqid as fq


def lag(a, b):
    return [[-a]], [[b]], [[1.0]], None


plant = fq.GreyBox(lag, [fq.Parameter("a", 20.0, lower=0.1), fq.Parameter("b", 900.0)], name="lag")
"""


@pytest.mark.study
@pytest.mark.parametrize(
    "model",
    [
        fq.two_mass().fix("d"),
        fq.two_mass().tie(Ja="1e4 * Jm").with_bounds(k=(1e4, np.inf)),
        fq.two_mass().with_bounds(d=(-np.inf, 100.0)).with_prior(k=(1.5e5, 1e4)),
        fq.drivetrain(2),
        fq.OutputError(3),
        fq.TransferFunction(2, 3),
    ],
    ids=[
        "fixed",
        "tied and bounded",
        "wide and believed in",
        "with arguments",
        "output error",
        "transfer function",
    ],
)
def test_it_runs_and_gives_the_same_numbers(model, file, tmp_path):
    est = fq.fit(model, fq.read(file, inputs="u"), band=(10, 80))
    code = lines(est, tmp_path)
    np.testing.assert_allclose(again(code, tmp_path), est.values, rtol=1e-9)


def test_of_several_records_and_a_start(file, tmp_path):
    data = [fq.read(file, stop=2.0), fq.read(file, start=2.0)]
    est = fq.fit(fq.two_mass(), data, band=(10, 80), start={"k": 1.4e5})
    np.testing.assert_allclose(again(lines(est, tmp_path), tmp_path), est.values, rtol=1e-9)


@pytest.mark.study
def test_of_an_own_plant_in_a_file(file, tmp_path):
    (tmp_path / "my_plant.py").write_text(OWN)
    run = subprocess.run(
        [sys.executable, "-m", "freqid.cli", "fit", str(file), "--model", "my_plant.py:plant",
         "--band", "10", "30", "--report", "axis.html", "--out", "axis.json"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (tmp_path / "axis.html").exists(), run.stderr
    page = (tmp_path / "axis.html").read_text(encoding="utf-8")
    code = html.unescape(re.search(r'<pre id="call">(.*?)</pre>', page, re.S)[1])
    values = fq.load(tmp_path / "axis.json", model=_own(tmp_path)).values
    np.testing.assert_allclose(again(code, tmp_path), values, rtol=1e-9)


def _own(folder):
    found = {"__name__": "my_plant"}
    exec((folder / "my_plant.py").read_text(), found)
    return found["plant"]


def test_what_no_file_holds_is_said(tmp_path):
    plant = fq.GreyBox(lambda a: ([[-a]], [[a]], [[1.0]], None), [fq.Parameter("a", 20.0)])
    record = fq.simulate(plant, fq.white_noise(300), 1e-3).with_noise(0.01)
    code = lines(fq.fit(plant, record), tmp_path)
    assert re.search(r"^model = \.\.\.  # <GreyBox", code, re.M)
    assert re.search(r"^data = \.\.\.  # <Record .*SHA-256 [0-9a-f]{12}$", code, re.M)
    compile(code, "recipe", "exec")


def test_a_function_with_others_around_it_is_said(tmp_path):
    def lag_of(gain):
        def lag(a):
            return [[-a]], [[gain]], [[1.0]], None

        return lag

    plant = fq.GreyBox(lag_of(3.0), [fq.Parameter("a", 20.0)])
    record = fq.simulate(plant, fq.white_noise(300), 1e-3).with_noise(0.001)
    code = lines(fq.fit(plant, record), tmp_path)
    assert re.search(r"^model = \.\.\.  # <GreyBox", code, re.M)
    compile(code, "recipe", "exec")


def test_data_that_were_changed_were_not_read(file):
    from freqid.data import source

    record = fq.read(file)
    assert source(record) == f"fq.read({str(file)!r})"
    assert source(dataclasses.replace(record, y=2 * record.y)) is None
    assert source(record.with_noise(np.array([0.1]))) == f"{source(record)}.with_noise([0.1])"
    assert source(record.with_noise(0.1 * record.y.std())).count("np.") == 0
    assert source(record.with_conditions(**{"my q": 1.0})) is None


@pytest.mark.study
@pytest.mark.parametrize("made", [
    lambda record: record.decimate(5),
    lambda record: record.detrend().slice(0.5, 3.5).decimate(4, keep_input=True),
    lambda record: record.with_hold("foh"),
    lambda record: record.with_noise(0.01, seed=3).with_conditions(Ja=11.0),
    lambda record: fq.etfe(record, band=(10, 80)),
    lambda record: fq.h1(record.decimate(2), 500, band=(10, 80)).select((12, 70)),
    lambda record: fq.etfe([record, record.with_noise(0.1)], (10, 80)),
    lambda record: [record.decimate(5), record.detrend()],
])  # fmt: skip
def test_what_was_done_to_the_data_is_done_again(made, file, tmp_path):
    est = fq.fit(fq.two_mass(k=1.45e5).fix("fm"), made(fq.read(file, inputs="u")))
    code = lines(est, tmp_path)
    assert "..." not in code
    assert "model = fq.two_mass(k=145000.0" in code
    np.testing.assert_allclose(again(code, tmp_path), est.values, rtol=1e-9)


@pytest.mark.study
def test_of_the_command_line_with_decimation(file, tmp_path):
    run = subprocess.run(
        [sys.executable, "-m", "freqid.cli", "fit", str(file), "--model", "two-mass", "--band",
         "10", "80", "--decimate", "4", "--hold", "zoh", "--report", "axis.html",
         "--out", "e.json"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (tmp_path / "axis.html").exists(), run.stderr
    page = (tmp_path / "axis.html").read_text(encoding="utf-8")
    code = html.unescape(re.search(r'<pre id="call">(.*?)</pre>', page, re.S)[1])
    assert f"data = fq.read({str(file)!r}).decimate(4, keep_input=False)" in code
    np.testing.assert_allclose(again(code, tmp_path), fq.load(tmp_path / "e.json").values)
    # what the screen says of it the page says too
    for said in re.findall(r"(?:witness|note|warning)[^:]*: (.*)", run.stdout):
        assert said[:60] in html.unescape(page), said


SCRIPT = """
import sys

import numpy as np

GAIN = 900.0
{own}
est = fq.fit(plant, fq.read(sys.argv[1], inputs="u"))
est.report("page.html")
print(*est.values.tolist(), sep="\\n")
"""


@pytest.mark.study
@pytest.mark.parametrize(
    ("taken", "uses"),
    [
        ("a, b", "np.eye(1)"), ("a, b", "[[float(bool(freqid.__version__))]]"),
        ("a, b", "GAIN * np.eye(1)"), ("a, b, c=GAIN", "c * np.eye(1)"),
        ("a, b", "(lambda: GAIN * np.eye(1))()"),
    ],
    ids=["alone", "freqid", "of a script", "a default of it", "a function inside"],
)  # fmt: skip
def test_of_a_plant_in_a_script(taken, uses, file, tmp_path):
    own = OWN.replace("[[1.0]]", uses).replace("a, b):", f"{taken}):")
    own = own.replace("import freqid as fq", "import freqid\nimport freqid as fq")
    (tmp_path / "script.py").write_text(SCRIPT.format(own=own))
    run = subprocess.run(
        [sys.executable, "script.py", file], cwd=tmp_path, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    code = html.unescape(re.search(r'<pre id="call">(.*?)</pre>', page, re.S)[1])
    assert ("model = ..." in code) == ("GAIN" in taken + uses), code
    if "GAIN" not in taken + uses:
        values = np.array(run.stdout.split(), dtype=float)
        np.testing.assert_allclose(again(code, tmp_path), values, rtol=1e-9)


def test_numbers_that_are_none_are_written_as_python_reads_them():
    for value in (np.inf, -np.inf, (10.0, np.inf), {"k": np.float64(-np.inf)}):
        assert eval(in_python(value)) == value
    assert np.isnan(eval(in_python(np.nan)))
    assert in_python(np.zeros(10**6)) is None
