"""What oscilloscopes and simulators of circuits print."""

import numpy as np
import pytest

import freqid as fq

N, DT = 200, 4e-4
T = DT * np.arange(N) - 0.1
U = np.random.default_rng(0).standard_normal(N)
Y = np.cumsum(U)
ROWS = "".join(f"{t:.6e},{u:.6e},{y:.6e}\n" for t, u, y in zip(T, U, Y, strict=True))
SETTINGS = (
    "Model,MSO44\nFirmware Version,1.26\n\nPoint Format,Y,,\nHorizontal Scale,0.04,,\n"
    "Record Length,2500,,\nProbe Attenuation,1,1,\nVertical Units,V,V,\nVertical Offset,0,0,\n"
    "Vertical Scale,1,1,\nLabel,,,\n,,,\nTIME,CH1,CH2\n"
)
FILES = {
    "tektronix.csv": (SETTINGS + ROWS, ("CH1", "CH2"), {}),
    "keysight.csv": ("x-axis,1,2\nsecond,Volt,Volt\n" + ROWS, ("1", "2"), {"1": "Volt"}),
    "siglent.csv": (
        "Record Length,Analog:2500\nVertical Units,CH1:V CH2:V\nHorizontal Units,s\n"
        "Source,CH1,CH2\nSecond,Volt,Ampere\n" + ROWS, ("CH1", "CH2"), {"CH2": "Ampere"},
    ),
    "ltspice.txt": (
        "time\tV(in)\tV(out)\n" + ROWS.replace(",", "\t"), ("V(in)", "V(out)"), {},
    ),
    "rigol.csv": (
        f"X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1.0e-01,{DT:e}\n"
        + "".join(f"{k},{u:.6e},{y:.6e},,\n" for k, (u, y) in enumerate(zip(U, Y, strict=True))),
        ("CH1", "CH2"), {"CH1": "Volt"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_names_units_and_samples(tmp_path, name):
    """Found: a setting was the line of names, or "column 'Volt' is there twice"."""
    text, channels, units = FILES[name]
    (tmp_path / name).write_text(text)
    record = fq.read(tmp_path / name)
    assert (*record.input_names, *record.output_names) == channels
    assert record.dt == pytest.approx(DT)
    assert units.items() <= record.units.items()
    assert np.allclose(record.u, U, rtol=1e-5)
    assert np.allclose(record.y, Y, rtol=1e-5, atol=1e-6)


def test_two_tables_below_one_another_are_still_not_one(tmp_path):
    path = tmp_path / "twice.csv"
    path.write_text(2 * ("time,u,y\n" + ROWS))
    with pytest.raises(ValueError, match="among its numbers"):
        fq.read(path)
    path.write_text("time,u,y\n" + "".join(ROWS.splitlines(True)[:9]) + "time,u,y\n" + ROWS)
    with pytest.raises(ValueError, match="among its numbers"):
        fq.read(path)
