"""Sums over segments as they grow, in a file from which an interrupted pass goes on."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np

from freqid.checks import ComplexArray, InputError
from freqid.data import Stream, check_arrays, whole_file
from freqid.frf.segments import Averaging, products, taper

# seconds between two writings of a state
_EVERY = 5.0


class RunningSums:
    """Sums of products of spectra, how many segments they are of, and the sample ``at`` which the
    next segment begins.

    With a ``path`` they are written every few seconds and at the end of a ``with`` block, whatever
    ends it.
    """

    def __init__(self, pairs: Sequence[str], path: Path | None = None, identity: str = "") -> None:
        self.pairs, self.path, self.identity = pairs, path, identity
        self.total: dict[str, ComplexArray] = {}
        self.count = self.at = 0
        self.written = time.monotonic()

    @classmethod
    def kept(
        cls,
        path: Path,
        pairs: Sequence[str],
        stream: Stream,
        averaging: Averaging,
        length: int,
        step: int,
    ) -> RunningSums:
        """Those that a file keeps, or new ones; ValueError for a file of something else."""
        if path.suffix != ".npz":
            raise InputError(f"state={str(path)!r} must end in .npz")
        made = cls(pairs, path, _identity(stream, averaging, length, step))
        if path.exists():
            made._read()
        taken = made.at + length - step if made.count else 0
        if stream.n_samples is not None and taken > stream.n_samples:
            raise InputError(
                f"state: {path} is of {taken} samples and more, and "
                f"{stream.origin} has {stream.n_samples}; it has lost some: give another name"
            )
        return made

    def add(self, spectra: Iterable[Mapping[str, ComplexArray]], count: int, samples: int) -> None:
        """Take the spectra of ``count`` segments more, which moves on by so many samples."""
        some: dict[str, ComplexArray] = {}
        for each in spectra:
            for pair in self.pairs:
                S = products(each[pair[0]], each[pair[1]])
                some[pair] = some[pair] + S if pair in some else S
        # at once, so that what is written belongs together whenever that is
        self.total = {pair: self.total.get(pair, 0) + S for pair, S in some.items()}
        self.count += count
        self.at += samples
        if self.path is not None and time.monotonic() - self.written > _EVERY:
            self._write()

    def __enter__(self) -> RunningSums:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        if self.path is None:
            if isinstance(error, InputError) and self.count:
                raise InputError(
                    f"{error}; with state='sums.npz' what is finished is kept"
                ) from error
            return
        if self.count:
            self._write()
        if isinstance(error, InputError) and self.count:
            raise InputError(
                f"{error}; the {self.count} segments before are kept in {self.path}, from which "
                "the same call goes on"
            ) from error

    def _write(self) -> None:
        assert self.path is not None
        kept = {f"total_{pair}": S for pair, S in self.total.items()}
        with whole_file(self.path) as beside:
            np.savez(
                beside, identity=np.array(self.identity), count=self.count, at=self.at,
                **kept,  # type: ignore[arg-type]
            )  # fmt: skip
        self.written = time.monotonic()

    def _read(self) -> None:
        assert self.path is not None
        try:
            check_arrays(self.path)
            with self.path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
                identity = str(file["identity"][()])
                count, at = int(file["count"][()]), int(file["at"][()])
                total = {pair: file[f"total_{pair}"] for pair in self.pairs}
        except InputError as error:
            raise InputError(f"state: {self.path}: {error}") from None
        except Exception as error:
            # numpy has errors of many kinds for a file that is not what it says
            raise InputError(
                f"state: {self.path} is no state of averages or is damaged; remove it"
            ) from error
        if identity != self.identity:
            raise InputError(
                f"state: {self.path} is of another stream or of other options; give another name "
                "or remove it"
            )
        self.count, self.at, self.total = count, at, total


def _identity(stream: Stream, averaging: Averaging, length: int, step: int) -> str:
    """A fingerprint of the options and of the stream's first segment."""
    seen = hashlib.sha256()
    detrend = averaging.detrend
    how = getattr(detrend, "__qualname__", repr(detrend))
    told = (stream.input_names, stream.output_names, stream.dt, length, step, how)
    seen.update(repr(told).encode())
    seen.update(np.ascontiguousarray(taper(averaging.window, length), dtype=float).tobytes())
    for _, u, y in stream.pieces(length, step, step):
        seen.update(np.ascontiguousarray(np.hstack([u, y])[:length]).tobytes())
        break
    return seen.hexdigest()
