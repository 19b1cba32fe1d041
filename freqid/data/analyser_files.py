"""Frequency responses from files that are no tables: Touchstone, universal files, MATLAB."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from freqid.checks import InputError, real
from freqid.data.frequency_response import FrequencyResponse
from freqid.data.readers.columns import text_of
from freqid.data.readers.kinds import damaged, existing, missing
from freqid.data.readers.mat import loaded
from freqid.data.readers.mat_forms import structure_of
from freqid.data.readers.uff import data_sets

if TYPE_CHECKING:
    import pandas as pd

# Hz of each unit of frequency
HERTZ = {
    "hz": 1.0, "hertz": 1.0, "1/s": 1.0, "s^-1": 1.0, "s-1": 1.0,
    "khz": 1e3, "mhz": 1e6, "ghz": 1e9,
    "rad/s": 1 / (2 * np.pi), "rad/sec": 1 / (2 * np.pi),
}  # fmt: skip
FREQUENCY = r"(f|freq|frequency|frequenz|angular frequency|w|omega|ω)"


def in_hertz(name: str, unit: str) -> float:
    """Hz of one step of a column of frequencies, by its unit or its name."""
    text = unit.casefold()
    plain = name.casefold().strip()
    if re.search(r"(?<![a-z])log", plain):
        raise InputError(f"column {name!r} may hold logarithms; give frequencies in Hz")
    if unit.strip() == "mHz":
        return 1e-3
    turned = re.search(r"^(w|omega|ω)(?![a-z])|rad|angular", plain)
    if text in ("1/s", "s^-1", "s-1") and turned:
        # the unit of an angular frequency, where the angle has none
        text = "rad/s"
    # "omega_rad/s" is a name and a unit of its own where the end is taken for one
    if not text or (text == "s" and plain.endswith("rad")):
        tail = re.search(r"(?:^f?|[_\s./-]|frequency)(hz|khz|mhz|ghz)\.*$", plain)
        text = tail[1] if tail else "rad/s" if turned else "hz"
    if text not in HERTZ:
        raise InputError(f"the unit of {name!r} is {unit!r}; expected one of {', '.join(HERTZ)}")
    return HERTZ[text]


def of_touchstone(path: Path) -> FrequencyResponse:
    try:
        import skrf
    except ImportError:
        raise missing("Touchstone", "scikit-rf", "rf") from None
    text = text_of(existing(path).read_bytes()).lstrip("\ufeff")
    content = io.StringIO(text)
    # by its name scikit-rf would unpickle the file before it takes it for text; the name tells how
    # many ports there are
    content.name = str(path)
    network = skrf.Network()
    try:
        network.read_touchstone(content)
    except Exception as error:
        # scikit-rf has errors of many kinds for a file that is not what it says
        raise damaged("Touchstone", error) from None
    # impedances, say, are what such a file holds, and no scattering made of them
    option = re.search(r"^\s*#\s*\S+\s+([SYZ])\s", text, re.I | re.M)
    kind = option[1].lower() if option else "s"
    G = np.asarray(getattr(network, kind))
    return FrequencyResponse(np.asarray(network.f), np.moveaxis(G, 0, -1))


def of_universal(path: Path) -> FrequencyResponse:
    sets = data_sets(path)
    # function type 4 is a frequency response
    found = [s for s in sets if s.get("type") == 58 and s.get("func_type") == 4]
    if not found:
        raise InputError("holds no frequency responses (data sets 58 of function type 4)")

    def end(s: dict[str, object], kind: str) -> str:
        return f"{s.get(f'{kind}_node', 0)}:{s.get(f'{kind}_dir', 0)}"

    outputs = list(dict.fromkeys(end(s, "rsp") for s in found))
    inputs = list(dict.fromkeys(end(s, "ref") for s in found))
    units: dict[str, str] = {}
    for s in found:
        # what is measured, over what it was driven by
        for name, label in ((end(s, "rsp"), "ordinate"), (end(s, "ref"), "orddenom")):
            unit = str(s.get(f"{label}_axis_units_lab") or "").strip()
            if unit and unit.upper() != "NONE":
                units[name] = unit
    label = str(found[0].get("abscissa_axis_units_lab") or "").strip()
    unit = "" if label.upper() == "NONE" else label
    f = np.asarray(found[0]["x"], dtype=float)
    G = np.full((len(outputs), len(inputs), len(f)), np.nan + 0j)
    for s in found:
        if len(s["x"]) != len(f) or not np.allclose(s["x"], f):
            raise InputError("its responses have unlike frequencies; read them one file each")
        if np.shape(s["data"]) != f.shape:
            raise InputError(f"holds {np.size(s['data'])} values at {len(f)} frequencies")
        G[outputs.index(end(s, "rsp")), inputs.index(end(s, "ref"))] = s["data"]
    if np.isnan(G).any():
        raise InputError(f"holds {len(found)} responses, not all of {outputs} from {inputs}")
    apart = not set(inputs) & set(outputs)
    return FrequencyResponse(
        f * in_hertz("abscissa", unit),
        G,
        input_names=inputs,
        output_names=outputs,
        units=units if apart else None,
    )


def of_matlab(
    path: Path, of_frame: Callable[[pd.DataFrame], FrequencyResponse]
) -> FrequencyResponse:
    """Frequencies and a complex array, or what ``of_frame`` takes, magnitude and phase, say."""
    try:
        content = loaded(existing(path))
    except NotImplementedError:
        raise InputError("is a MAT file of version 7.3; save it as version 7") from None
    content = {k: v for k, v in content.items() if not k.startswith("__")}
    responses = [s for v in content.values() if "ResponseData" in (s := structure_of(v) or {})]
    if len(responses) == 1:
        # the properties of frd and idfrd, whose frequencies are in rad/s where they do not say
        content = responses[0]
        unit = str(content.get("FrequencyUnit", "rad/s")).replace("TimeUnit", "s")
        content = {**content, "FrequencyUnit": unit}
    arrays = {k: np.asarray(v) for k, v in content.items()}
    found = [k for k, v in arrays.items() if np.iscomplexobj(v) and v.ndim >= 1]
    if not found:
        import pandas as pd

        long = {k: v for k, v in arrays.items() if v.ndim == 1 and v.dtype.kind in "fiu"}
        if len(long) > 2 and len({len(v) for v in long.values()}) == 1:
            return of_frame(pd.DataFrame(long))
    axes = [k for k in arrays if re.fullmatch(rf"{FREQUENCY}(_hz)?", k.casefold())]
    if len(found) != 1 or not axes:
        raise InputError(
            f"holds {', '.join(arrays)}; expected frequencies f (Hz) or w (rad/s) and one complex "
            "array"
        )
    f = np.asarray(real(axes[0], arrays[axes[0]]))
    if f.dtype.kind not in "fiu":
        raise InputError(f"{axes[0]!r} holds {f.dtype}; expected frequencies, numbers")
    # what is beyond numbers is told below
    with np.errstate(all="ignore"):
        f = f.astype(float) * in_hertz(axes[0], str(np.squeeze(arrays.get("FrequencyUnit", ""))))
    G = arrays[found[0]]
    if G.ndim > 1 and G.shape[0] == len(f) and G.shape[-1] != len(f):
        G = np.moveaxis(G, 0, -1)
    step = arrays.get("Ts", np.empty(0)) if responses else np.empty(0)
    dt = float(step) if step.size == 1 and step.dtype.kind in "fiu" and step > 0 else 0.0
    return FrequencyResponse(f, G if G.ndim != 2 else G[:, None], dt=dt)
