"""Sentences that name arguments of Python, as who types a command reads them."""

from __future__ import annotations

import re

# arguments that are options of a command, by other names or the same
_OPTIONS = {"inputs": "input", "outputs": "output"} | {
    name: name.replace("_", "-")
    for name in (
        "reference", "dt", "time", "sep", "decimal", "columns", "group", "units", "resample",
        "hold", "band", "weights", "offset", "loss", "n_starts", "keep_input", "domain",
        "initial_state", "conditions", "start", "segment", "method",
    )
}  # fmt: skip
# ``dt=``, ``dt=0.01`` or ``inputs=None``, and no part of a name, a call or an option
_ARGUMENT = re.compile(
    rf"(?:^|(?<=\s)|(?<=\s\())({'|'.join(_OPTIONS)})=(None\b|True\b|(?=[\s:;,.)]|$))?"
)
_PAIR = re.compile(r"--(units|conditions|start) \{'([^']*)': '?([^'}]*)'?\}")


def typed(sentence: str) -> str:
    """A sentence in which arguments are options of the command line.

    >>> typed("inputs=None, outputs=None: name them; or give dt=0.01, or resample=True")
    'no --input, no --output: name them; or give --dt 0.01, or --resample'
    """

    def option(found: re.Match[str]) -> str:
        name = f"--{_OPTIONS[found[1]]}"
        return f"no {name}" if found[2] == "None" else name if found[2] is not None else f"{name} "

    told = _ARGUMENT.sub(option, sentence)
    return _PAIR.sub(r"--\1 \2=\3", told)
