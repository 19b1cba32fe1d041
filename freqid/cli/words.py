"""Sentences that name arguments of Python, as who types a command reads them."""

from __future__ import annotations

import re
import shlex
from dataclasses import fields

from freqid.cli.options import RENAMED, Reading, Search

# what arguments are called on the command line, and which of them are switches there
_NAMES = (
    *(f.name for group in (Reading, Search) for f in fields(group)),
    "keep_input", "domain", "initial_state", "conditions", "start", "segment",
)  # fmt: skip
_OPTIONS = {RENAMED.get(name, name): name.replace("_", "-") for name in _NAMES}
_SWITCHES = "resample|keep_input"
# ``dt=``, ``resample=True`` or ``inputs=None``: one with a value of its own may be what was typed
_ARGUMENT = re.compile(
    rf"(?:^|(?<=\s)|(?<=\s\())(?:({_SWITCHES})=True\b|"
    rf"({'|'.join(_OPTIONS)})=(None\b|(?=[\s:;,.)]|$)))"
)
# what is typed in another way than it is called
_OTHERWISE = {
    "offset='estimate'": "--offset",
    "read(start=, stop=)": "--between START STOP",
    "load(path, model=plant)": "--model your_file.py:plant",
}
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
        return f"{'no ' if found[3] == 'None' else ''}--{_OPTIONS[found[1] or found[2]]}"

    def units(found: re.Match[str]) -> str:
        return f"--units {shlex.quote(f'{found[2]}={found[3]}')}"

    for called, option_of in _OTHERWISE.items():
        sentence = sentence.replace(called, option_of)
    return _UNITS.sub(units, _ARGUMENT.sub(option, sentence))
