"""Sentences that name arguments of Python, as who types a command reads them."""

from __future__ import annotations

import re
import shlex

# arguments that are options of a command, by other names or the same
_OPTIONS = {"inputs": "input", "outputs": "output"} | {
    name: name.replace("_", "-")
    for name in (
        "reference", "dt", "time", "sep", "decimal", "columns", "group", "units", "resample",
        "hold", "band", "weights", "offset", "loss", "n_starts", "keep_input", "domain",
        "initial_state", "conditions", "start", "segment", "method",
    )
}  # fmt: skip
# ``dt=``, ``resample=True`` or ``inputs=None``: one with a value of its own may be what was typed
_ARGUMENT = re.compile(
    rf"(?:^|(?<=\s)|(?<=\s\())({'|'.join(_OPTIONS)})=(None\b|True\b|(?=[\s:;,.)]|$))"
)
# what stands within the brackets of a call
_CALL = re.compile(r"\w\([^()]*$")
_UNITS = re.compile(r"units=\{(['\"])(.+?)\1: '([^']*)'\}")


def typed(sentence: str) -> str:
    """A sentence in which arguments are options of the command line.

    >>> typed("inputs=None, outputs=None: name them; sep= parts cells, resample=True fills gaps")
    'no --input, no --output: name them; --sep parts cells, --resample fills gaps'
    """

    def option(found: re.Match[str]) -> str:
        if _CALL.search(sentence, 0, found.start()):
            return found[0]
        return f"{'no ' if found[2] == 'None' else ''}--{_OPTIONS[found[1]]}"

    def units(found: re.Match[str]) -> str:
        return f"--units {shlex.quote(f'{found[2]}={found[3]}')}"

    return _UNITS.sub(units, _ARGUMENT.sub(option, sentence))
