"""Every Python example of the pages runs as it stands, in the page's own order."""

import importlib.util
import logging
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

import freqid as fq

DOCS = Path(__file__).parents[1] / "docs"


def examples(page):
    return re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(), re.S)


def world(folder):
    """The files and names that the pages say are the reader's own."""
    plant = fq.two_mass()
    u = fq.chirp(5, 100, duration=4, dt=2e-3)
    clean = fq.simulate(plant, u, 2e-3, input_names=["torque"], output_names=["velocity"])
    repeats = [clean.with_noise(0.01 * clean.y.std(), seed=seed) for seed in range(4)]
    record, other = repeats[:2]
    (folder / "logs").mkdir()
    for number, one in enumerate(repeats):
        fq.write(one, folder / "logs" / f"{number}.parquet")
    noise = fq.white_noise(50_000, seed=9)
    day = fq.simulate(plant, noise, 2e-3).with_noise(0.1, seed=10)
    with h5py.File(folder / "log.h5", "w") as file:
        file["time"], file["torque"], file["velocity"] = day.time, day.u, day.y
    t = record.time
    signals = {"torque": record.u, "angle": np.cumsum(record.y) * 2e-3, "acceleration": record.y}
    scipy.io.savemat(folder / "run.mat", {"time": t, **signals})
    f = np.linspace(1, 100, 300)
    G = plant.frequency_response(2 * np.pi * f).response[0, 0]
    G = G * (1 + 0.01 * np.random.default_rng(0).standard_normal(len(f)))
    rows = np.column_stack([f, 20 * np.log10(abs(G)), np.degrees(np.unwrap(np.angle(G)))])
    header = "frequency [Hz],magnitude [dB],phase [deg]"
    np.savetxt(folder / "frf.csv", rows, delimiter=",", header=header, comments="")
    return {
        "fq": fq, "np": np, "Path": Path, "plant": plant, "model": plant, "record": record,
        "records": repeats[:2], "repeats": repeats, "other_record": other, "another_record": other,
        "est": fq.fit(plant, record), "u": u, "Q": np.eye(3), "R": np.eye(1),
    }  # fmt: skip


@pytest.fixture
def quiet():
    """Examples may set up logging: afterwards it is as it was."""
    root, ours = logging.getLogger(), logging.getLogger("freqid")
    handlers, level = list(root.handlers), ours.level
    yield
    root.handlers[:] = handlers
    ours.setLevel(level)


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("page", ["howto.md", "trust.md", "scale.md", "robot.md"])
def test_examples_of_a_page_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = world(tmp_path)
    own = dict(names)
    found = examples(page)
    assert found
    for number, text in enumerate(found):
        exec(compile(text, f"{page}, example {number + 1}", "exec"), names)
        if page == "howto.md":
            # each of its sections begins with the reader's own
            names.update({key: own[key] for key in ("record", "plant", "est")})


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: fq.two_mass().with_values(j=1.0),
        lambda: fq.Record([1.0, np.nan], [1.0, 2.0], dt=1e-3),
        lambda: fq.read("/nowhere/axis.csv"),
        lambda: fq.chirp(10, 80, 1.0, -1e-3),
        lambda: fq.bode(),
        lambda: fq.fit(fq.two_mass(), fq.Record([1.0, 2.0], [1.0, 2.0], dt=1e-3), band=(600, 700)),
    ],
)
def test_what_is_raised_is_on_the_page_of_messages(wrong):
    spec = importlib.util.spec_from_file_location("messages", DOCS / "hooks" / "messages.py")
    hook = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(hook)
    listed = re.findall(r"^- `(.*)`$", hook.listed(), re.M)
    assert len(listed) > 400
    with pytest.raises((ValueError, FileNotFoundError)) as raised:
        wrong()
    text = str(raised.value).replace("`", "'")
    assert any(re.fullmatch(re.escape(t).replace("…", ".*"), text, re.S) for t in listed), text


def test_the_tutorials_three_commands(tmp_path, monkeypatch, capsys):
    """A first day: from a semicolon file of one's own to a report about one's own plant."""
    from freqid.cli.commands import main

    page = (DOCS / "index.md").read_text()
    commands = re.findall(r"^freqid .*(?:my_plant|mine\.csv).*$", page, re.M)
    assert len(commands) == 3
    monkeypatch.chdir(tmp_path)
    lag = fq.GreyBox(
        lambda J, k, d: ([[0, 1], [-k / J, -d / J]], [[0], [1 / J]], [[1, 0]], None),
        [fq.Parameter("J", 0.12), fq.Parameter("k", 90.0), fq.Parameter("d", 0.3)],
    )
    record = fq.simulate(lag, fq.white_noise(2000, seed=1), 5e-3).with_noise(snr=30)
    rows = np.column_stack([1e3 * record.time, record.u, record.y])
    body = "\n".join(";".join(f"{v:.9f}" for v in row) for row in rows).replace(".", ",")
    (tmp_path / "mine.csv").write_text(f"Zeit [ms];Moment [N m];Winkel [rad]\n{body}\n")
    for command in commands:
        with pytest.raises(SystemExit) as end:
            main(command.split()[1:])
        assert end.value.code == 0, capsys.readouterr().err
    assert "verdict: trust" in capsys.readouterr().out
    assert (tmp_path / "est.html").stat().st_size > 1e5
    assert (tmp_path / "mine.png").exists()
