"""How a file gets from the page to ``freqid.read``: in pieces, each no larger than any request."""

from __future__ import annotations

import re
import shutil
import tempfile
import weakref
from collections import OrderedDict
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from freqid.checks import InputError
from freqid.pages.explorer.subjects import Subjects, choices

if TYPE_CHECKING:
    from flask import Flask, Response

# bytes of a file, and files that are on their way or may be asked again for other channels
LARGEST_FILE, _OPEN = 2**28, 4
# bytes of a file's name
_LONGEST = 100
_KEY, _NAME = re.compile(r"[0-9a-f]{16}"), re.compile(r"[^\w.+\- ]+")


class Uploads:
    """Files on their way, each in a folder of its own that goes with the process."""

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="freqid-explorer-"))
        weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        self._paths: OrderedDict[str, Path] = OrderedDict()
        self._turn = Lock()

    def add(self, key: str, name: str, at: int, piece: bytes) -> None:
        """The piece of a file that begins ``at`` that byte; ValueError for one out of order."""
        with self._turn:
            path = self._made(key, name)
            size = path.stat().st_size if path.exists() else 0
            if at != size:
                raise InputError(f"a piece at byte {at} of a file of which {size} are there")
            if size + len(piece) > LARGEST_FILE:
                raise InputError(
                    f"the file has more than {LARGEST_FILE >> 20} MiB; start the page with it: "
                    f"freqid explore {path.name}"
                )
            with path.open("ab") as file:
                file.write(piece)

    def path(self, key: str) -> Path:
        """Where a file lies that has come; ValueError for a key that none has."""
        with self._turn:
            if not _KEY.fullmatch(key):
                raise InputError("a key has sixteen hexadecimal digits")
            if key not in self._paths:
                raise InputError("no such file has come here; drop it again")
            self._paths.move_to_end(key)
            return self._paths[key]

    def _made(self, key: str, name: str) -> Path:
        """A new place for a file, under its own name, or the one that it has."""
        if not _KEY.fullmatch(key):
            raise InputError("a key has sixteen hexadecimal digits")
        if key not in self._paths:
            plain = _NAME.sub("_", Path(name.replace("\\", "/")).name).lstrip(".")
            # file systems count bytes
            short = plain.encode()[-_LONGEST:].decode(errors="ignore")
            self._paths[key] = self._folder / key / (short or "file")
            self._paths[key].parent.mkdir(exist_ok=True)
        self._paths.move_to_end(key)
        while len(self._paths) > _OPEN:
            _, old = self._paths.popitem(last=False)
            shutil.rmtree(old.parent, ignore_errors=True)
        return self._paths[key]


def receive(server: Flask, subjects: Subjects) -> None:
    """Take files by ``/piece`` and read them by ``/read``, which say what went wrong as JSON."""
    from flask import jsonify, request

    uploads = Uploads()

    def piece() -> Response:
        asked = request.args
        try:
            at = int(asked.get("at", "0"))
            uploads.add(asked.get("key", ""), asked.get("name", ""), at, request.get_data())
        except ValueError as error:
            return jsonify(error=str(error))
        return jsonify(error=None)

    def read() -> Response:
        asked = request.args
        try:
            path = uploads.path(asked.get("key", ""))
        except ValueError as error:
            return jsonify(error=str(error), channels=[])
        try:
            subjects.drop(asked["key"], path, asked.getlist("input"), asked.getlist("output"))
        except (ValueError, OSError) as error:
            # the folder is nobody's business
            said = str(error).replace(f"{path.parent}/", "")
            return jsonify(error=said, channels=choices(path))
        return jsonify(error=None, channels=[])

    server.add_url_rule("/piece", "piece", piece, methods=["POST"])
    server.add_url_rule("/read", "read", read, methods=["POST"])
