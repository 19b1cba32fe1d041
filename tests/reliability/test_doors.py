"""The explorer's requests and links, and what the command line meets on a real machine."""

import os
import random
import signal
import stat
import subprocess
import sys
import time
import warnings
from urllib.parse import urlencode

import numpy as np
import pytest

import freqid as fq
from freqid.pages.explorer.doors import LARGEST
from freqid.pages.explorer.figures import bias_figure, bode_figure, nyquist_figure, time_figure
from freqid.pages.explorer.page import application, free_port
from freqid.pages.explorer.scene import scene
from freqid.pages.explorer.state import HOLDS, PLANTS, State

RNG = np.random.default_rng(0)
FREQID = [sys.executable, "-m", "freqid.cli"]


@pytest.fixture(scope="module")
def client():
    pytest.importorskip("dash")
    return application().server.test_client()


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200), ({"Host": "127.0.0.1:8050"}, 200), ({"Host": "[::1]:8050"}, 200),
        ({"Host": "evil.example"}, 403), ({"Host": "127.0.0.1.evil.example"}, 403),
        ({"Host": "localhost@evil.example"}, 403), ({"Host": "evil.example:8050"}, 403),
        ({"Host": "[::1"}, 403), ({"Host": ""}, 403), ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403), ({"Origin": "http://localhost:8050"}, 200),
    ],
)  # fmt: skip
def test_only_this_machine_is_answered(client, headers, status):
    """Any Host was answered: another site could read the record through the browser."""
    assert client.get("/", headers=headers).status_code == status
    assert client.get("/_dash-layout", headers=headers).status_code == status


def test_crafted_requests(client):
    """500 of them: none is a 500, and no body above 1 MiB is taken."""
    at = "/_dash-update-component"
    assert client.post(at, data=b"x" * (LARGEST + 1)).status_code == 413
    chunked = {"Transfer-Encoding": "chunked"}
    assert client.post(at, data=b"x", headers=chunked).status_code == 411
    outputs = client.get("/_dash-dependencies").get_json()
    draw = next(d for d in outputs if "bode" in d["output"])
    usual = {
        "plant": "first-order", "factor": 2, "hold": "zoh", "band": [0.5, 1.5], "noise": 0,
    }  # fmt: skip
    valid = {
        "output": draw["output"], "changedPropIds": [],
        "state": [[], {"id": "url", "property": "search", "value": ""}],
        "outputs": [
            {"id": o.rpartition(".")[0], "property": o.rpartition(".")[2]}
            for o in draw["output"].strip(".").split("...")
        ],
        "inputs": [
            *({**each, "value": usual.get(each["id"], 0)} for each in draw["inputs"][:-1]), [],
        ],
    }  # fmt: skip
    # what the page itself asks is answered: the rest of the answers below are refusals
    answer = client.post(at, json=valid)
    assert answer.status_code == 200
    assert "verdict" in answer.get_data(as_text=True)
    odd = [None, "a", -1, 1e400, [], {}, [1], "nan", 10**400, True, "../etc", {"a": 1}]
    for i in range(500):
        r = random.Random(i)
        inputs = [{**each, "value": r.choice(odd)} for each in draw["inputs"]]
        body = {
            "output": draw["output"] if r.random() < 0.8 else r.choice(odd),
            "inputs": inputs if r.random() < 0.8 else r.choice(odd),
            "state": r.choice([[], odd, None]), "outputs": r.choice(odd),
            "changedPropIds": r.choice([[], odd, None]),
        }  # fmt: skip
        answer = client.post(at, json=body)
        assert answer.status_code in (200, 204, 400, 404, 405), (i, answer.status_code)


def test_files_come_in_order_and_stay_in_their_folder(client, tmp_path):
    """Pieces of files: keys, places, sizes and names that are none are refused, in words."""
    key = "0123456789abcdef"
    table = b"t;u;y\n" + b"".join(b"%d;%d;%d\n" % (i, i % 5, i % 7) for i in range(300))

    def piece(data, **asked):
        at = {"key": key, "name": "a.csv", "at": 0} | asked
        return client.post("/piece", query_string=at, data=data)

    def read(**asked):
        return client.post("/read", query_string={"key": key, "name": "a.csv"} | asked).get_json()

    assert piece(b"x" * (LARGEST + 1)).status_code == 413
    assert piece(b"x", headers={}).status_code == 200
    evil = client.post(
        "/piece", query_string={"key": key}, headers={"Origin": "http://evil.example"}
    )
    assert evil.status_code == 403
    for odd in ("", "..", "0123", "../../../etc/pas", "0123456789ABCDEF", "g" * 16):
        assert "hexadecimal" in piece(b"x", key=odd).get_json()["error"]
        assert "hexadecimal" in read(key=odd)["error"]
    assert "at byte 0" in piece(b"again").get_json()["error"]
    assert piece(b"", at="x").get_json()["error"]
    other = "f" * 16
    assert "no such file" in read(key=other)["error"]
    for part in range(0, len(table), 100):
        assert piece(table[part : part + 100], key=other, at=part).get_json()["error"] is None
    assert read(key=other) == {"error": None, "channels": []}
    # who asks for what never came takes nothing from those that did
    for number in range(20):
        assert "no such file" in read(key=f"{number:016x}"[::-1])["error"]
    assert read(key=other) == {"error": None, "channels": []}
    assert piece(table, key="d" * 16, name="測" * 100 + ".csv").get_json()["error"] is None
    assert read(key="d" * 16)["error"] is None
    assert piece(table, key="c" * 16, name="../../etc/passwd").get_json()["error"] is None
    assert "etc" not in str(read(key="c" * 16))


@pytest.mark.study
@pytest.mark.parametrize("part", range(3))
def test_links_and_records_of_any_kind(part):
    """A link ?sine=1e9, and records with a sample time of a second or more, ended in tracebacks."""
    u = RNG.standard_normal(400)
    y = np.convolve(u, [0, 0.3, 0.2, 0.1])[:400] + 0.01 * RNG.standard_normal(400)
    records = [None, fq.Record([1.0, 2, 3], [1.0, 2, 3], 0.1), fq.Record(u[:50] * 0, u[:50], 0.1)]
    for dt in (2.0, 10.0, 1e-6):
        records += [fq.Record(u, y, dt), fq.Record(u, y[::4], 4 * dt, input_dt=dt)]
        records += [fq.Record(np.c_[u, u**2], np.c_[y, y], dt)]
    for i in range(40 * part, 40 * part + 40):
        r = random.Random(i)
        query = {
            "plant": r.choice([*PLANTS, "x"]), "hold": r.choice([*HOLDS, "y"]),
            "factor": r.choice(["1", "3", "40", "-1", "a", "1e9"]),
            "low": r.choice(["10", "0", "1e9", "nan", "-1", "1e-9"]),
            "high": r.choice(["80", "1e9", "0", "inf"]), "noise": r.choice(["0", "0.1", "5", "-1"]),
            "sine": r.choice(["0", "0", "8", "1e9", "1e-9", "900", "1e400"]),
            "x.k": r.choice(["1", "5", "1e9", "nan"]),
        }  # fmt: skip
        record = r.choice(records)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            shown = scene(State.of("?" + urlencode(query)), record)
            for draw in (bode_figure, nyquist_figure, time_figure, bias_figure):
                draw(shown)
            assert State.of(shown.state.query()).query() == shown.state.query()
            assert "print(est)" in shown.state.code(record)


@pytest.mark.parametrize("port", [70000, 0, -1, 65536])
def test_a_port_that_is_none(port):
    with pytest.raises(ValueError, match="port"):
        free_port("127.0.0.1", port)


@pytest.fixture(scope="module")
def day(tmp_path_factory):
    folder = tmp_path_factory.mktemp("day")
    fq.write(fq.simulate(fq.first_order(), fq.chirp(2, 40, 2, 5e-3), 5e-3), folder / "a.csv")
    return folder


def told(day, *arguments, **options):
    run = subprocess.run(
        [*FREQID, *arguments], cwd=day, text=True, timeout=100, check=False,
        stderr=subprocess.PIPE, **{"stdout": subprocess.PIPE, **options},
    )  # fmt: skip
    assert "Traceback" not in run.stderr
    return run.returncode, run.stderr


def test_screens_that_end(day):
    with open("/dev/full", "w") as full:
        code, said = told(day, "frf", "a.csv", stdout=full)
    assert (code, said.strip()) == (
        2, "freqid: the output cannot be written: No space left on device",
    )  # fmt: skip
    command = " ".join([*FREQID, "frf", "a.csv", "|", "head", "-1"])
    run = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], cwd=day, capture_output=True, text=True,
        timeout=100, check=False,
    )  # fmt: skip
    assert (run.returncode, run.stderr) == (0, "")
    assert "frequency" in run.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["frf", "a.csv", "--out", "a.csv/x.csv"], "is a file and no folder"),
        (["frf", "a.csv", "--plot", "NAME"], "must end in .png"),
        (["frf", "a.csv", "--out", "x.xyz"], "must end in .csv"),
        (["frf", "a.csv", "--out", "a.csv", "--force"], "never overwritten"),
        (["frf", "a.csv", "--out", "/proc/x.csv"], "/proc/x.csv"),
        (["fit", "a.csv", "--model", "first-order", "--report", "NAME"], "must end in .html"),
        (["bias", "--model", "first-order", "--chirp", "2", "40", "--factor", "2", "--out",
          "a.csv/x.csv"], "no folder"),
        (["explore", "--port", "70000"], "no port"),
    ],
)  # fmt: skip
def test_nothing_is_left_behind(day, arguments, words):
    before = {p.name: p.read_bytes() for p in day.iterdir()}
    code, said = told(day, *arguments)
    assert code == 2
    assert words in said
    assert said.count("\n") == 1
    assert "-" not in said.split("/proc/")[-1] or "/proc/" not in said
    assert {p.name: p.read_bytes() for p in day.iterdir()} == before


def end_tidily(process, begun):
    """Tell a command to end once it has begun: it does, and says no more."""
    for _ in range(1200):
        if begun():
            break
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert "Traceback" not in said


def test_told_to_end_it_ends_tidily(day):
    process = subprocess.Popen(
        [*FREQID, "reproduce", "--out", "figures"], cwd=day,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    figures = day / "figures"
    end_tidily(process, lambda: figures.is_dir() and any(figures.glob("fig*.png")))
    assert not [p for p in figures.iterdir() if p.name.startswith(".")]
    assert all(p.stat().st_size > 0 for p in figures.iterdir())


def test_an_exit_that_a_callback_drops_is_said_at_the_end():
    """It was 0 where the signal came while a library called back."""
    run = subprocess.run(
        [sys.executable, "-c", """
import os, signal, freqid.cli.commands as commands
def work(*arguments, **options):
    try:
        os.kill(os.getpid(), signal.SIGTERM)
    except BaseException:
        pass
commands.app = work
commands.main([])
"""],
        check=False, timeout=100,
    )  # fmt: skip
    assert run.returncode == 128 + signal.SIGTERM


def test_many_fits_end_where_they_are_told_to(day):
    """They went on to their end, and the record in progress was a failed row."""
    pytest.importorskip("pyarrow")
    (day / "slow.py").write_text("""
import pathlib, time
import freqid as fq
calls = []
def matrices(a):
    calls.append(a)
    if len(calls) == 100:
        pathlib.Path("begun").touch()
    time.sleep(0.01)
    return [[-a]], [[a]], [[1]], None
plant = fq.GreyBox(matrices, [fq.Parameter("a", 30.0)])
""")
    for k in range(8):
        plant = fq.first_order(a=20.0 + k, b=20.0 + k)
        fq.write(fq.simulate(plant, fq.white_noise(300, seed=k), 0.01), day / f"log{k}.csv")
    process = subprocess.Popen(
        [*FREQID, "fit-many", "log*.csv", "--model", "slow.py:plant", "--out", "table.parquet",
         "--jobs", "1"],
        cwd=day, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    end_tidily(process, (day / "begun").exists)
    assert not (day / "table.parquet").exists()


def test_a_full_disk_leaves_no_file(day, tmp_path):
    if os.geteuid():
        pytest.skip("needs the right to mount a small disk")
    small = tmp_path / "small"
    small.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", str(small)],
        capture_output=True, check=False,
    )  # fmt: skip
    if mounted.returncode:
        pytest.skip("no right to mount a small disk")
    try:
        code, said = told(day, "frf", "a.csv", "--out", str(small / "x.csv"))
        assert code == 2
        assert "No space left on device" in said
        assert not list(small.iterdir())
    finally:
        subprocess.run(["umount", str(small)], check=True)


def test_what_is_no_file_is_not_replaced(day):
    """A link to a device had the device itself replaced by a file."""
    (day / "est.json").symlink_to("/dev/full")
    os.mkfifo(day / "pipe.json")
    for name in ("est.json", "pipe.json"):
        words = "a.csv", "--model", "first-order", "--out", name, "--force"
        code, said = told(day, "fit", *words)
        assert code == 2
        assert "no file but a device or a pipe" in said
        with pytest.raises(ValueError, match="device or a pipe"):
            fq.write(fq.read(day / "a.csv"), (day / name).rename(day / name.replace("json", "csv")),
                     overwrite=True)  # fmt: skip
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


@pytest.mark.study
@pytest.mark.parametrize("words", [["show", "none.csv"], ["--version"], ["frf", "a.csv"]])
def test_without_a_screen_nothing_breaks(day, words):
    run = subprocess.run(
        ["sh", "-c", f"{' '.join([*FREQID, *words])} >&-"], cwd=day, capture_output=True, text=True,
        check=False, timeout=100,
    )  # fmt: skip
    assert "Traceback" not in run.stderr


def test_a_screen_without_a_sign_shows_the_rest(day):
    run = subprocess.run(
        [*FREQID, "fit", "a.csv", "--model", "first-order"], cwd=day, capture_output=True,
        check=False, timeout=100, env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )  # fmt: skip
    assert b"verdict" in run.stdout
    assert not run.stderr
