"""Sums over segments as they grow, in a file from which an interrupted pass goes on."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType

import numpy as np

from freqid.checks import ComplexArray, FloatArray, InputError
from freqid.data import Stream, check_arrays, whole_file
from freqid.frf.function_identity import identity_of
from freqid.frf.segments import Averaging, taper

# seconds between two writings of a state; part of the largest sample that is down to rounding
_EVERY, _ROUNDING = 5.0, 1e-9


@dataclass(frozen=True)
class _Sums:
    """Sums of products of spectra by pair, of so many segments, and the sample ``at`` which the
    next begins; whether the stream had ``ended``, and how long it said it was.
    """

    total: Mapping[str, ComplexArray]
    count: int = 0
    at: int = 0
    ended: bool = False
    n_samples: int = -1


class RunningSums:
    """Sums over the segments of a stream, as they grow.

    With a ``path`` they are written every few seconds and at the end of a ``with`` block, whatever
    ends it.
    """

    def __init__(
        self,
        pairs: Sequence[str],
        path: Path | None = None,
        identity: str = "",
        first: FloatArray | None = None,
    ) -> None:
        self.pairs, self.path, self.identity = pairs, path, identity
        self.first = np.empty(0) if first is None else first
        self.sums = _Sums({})
        self.n_samples, self.grows = -1, True
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
        identity = _identity(stream, averaging, length, step)
        made = cls(pairs, path, identity, _first(stream, length, step))
        if path.exists():
            made._read()
        made.n_samples = -1 if stream.n_samples is None else stream.n_samples
        made.grows = not stream.ahead
        sums = made.sums
        taken = sums.at + length - step if sums.count else 0
        if stream.n_samples is not None and taken > stream.n_samples:
            raise InputError(
                f"state: {path} is of {taken} samples and more, and {stream.origin} has "
                f"{stream.n_samples}; it has lost some: give another name"
            )
        if sums.ended and not made.grows and sums.n_samples != made.n_samples:
            raise made._too_late()
        return made

    def add(self, sums: Mapping[str, ComplexArray], count: int, samples: int) -> None:
        """Take the sums by pair of ``count`` segments more, which moves on by so many samples."""
        before = self.sums
        if before.ended and not self.grows:
            raise self._too_late()
        total = {pair: before.total[pair] + S if before.count else S for pair, S in sums.items()}
        # in one piece, so that what is written belongs together whenever that is
        self.sums = _Sums(total, before.count + count, before.at + samples)
        if self.path is not None and time.monotonic() - self.written > _EVERY:
            self._write()

    def _too_late(self) -> InputError:
        return InputError(
            f"state: {self.path} is of a stream that had ended, as its filter has seen; give "
            "another name for one that has grown"
        )

    def __enter__(self) -> RunningSums:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        count, told = self.sums.count, isinstance(error, InputError) and not self.sums.ended
        if self.path is None:
            if told and count:
                raise InputError(
                    f"{error}; with state='sums.npz' what is finished is kept"
                ) from error
            return
        if error is None:
            self.sums = replace(self.sums, ended=True, n_samples=self.n_samples)
        if count:
            self._write()
        if told and count:
            raise InputError(
                f"{error}; the {count} segments before are kept in {self.path}, from which the "
                "same call goes on"
            ) from error

    def _write(self) -> None:
        assert self.path is not None
        s = self.sums
        kept = {f"total_{pair}": S for pair, S in s.total.items()}
        with whole_file(self.path) as beside:
            np.savez(
                beside, identity=np.array(self.identity), count=s.count, at=s.at, ended=s.ended,
                n_samples=s.n_samples, first=self.first, **kept,  # type: ignore[arg-type]
            )  # fmt: skip
        self.written = time.monotonic()

    def _read(self) -> None:
        assert self.path is not None
        try:
            check_arrays(self.path)
            with self.path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
                identity, first = str(file["identity"][()]), file["first"]
                numbers = [int(file[n][()]) for n in ("count", "at", "ended", "n_samples")]
                total = {pair: file[f"total_{pair}"] for pair in self.pairs}
        except InputError as error:
            raise InputError(f"state: {self.path}: {error}") from None
        except Exception as error:
            # numpy has errors of many kinds for a file that is not what it says
            raise InputError(
                f"state: {self.path} is no state of averages or is damaged; remove it"
            ) from error
        # a filter rounds as its blocks fall
        near = _ROUNDING * np.abs(self.first).max(initial=0)
        alike = first.shape == self.first.shape and (np.abs(first - self.first) <= near).all()
        if identity != self.identity or not alike:
            raise InputError(
                f"state: {self.path} is of another stream or of other options; give another name "
                "or remove it"
            )
        count, at, ended, n_samples = numbers
        self.sums = _Sums(total, count, at, bool(ended), n_samples)


def _identity(stream: Stream, averaging: Averaging, length: int, step: int) -> str:
    """A fingerprint of the options and of what is known of a stream."""
    seen = hashlib.sha256()
    how = identity_of(averaging.detrend)
    told = (stream.input_names, stream.output_names, stream.dt, length, step, how)
    seen.update(repr(told).encode())
    seen.update(np.ascontiguousarray(taper(averaging.window, length), dtype=float).tobytes())
    return seen.hexdigest()


def _first(stream: Stream, length: int, step: int) -> FloatArray:
    """A stream's first segment, (length, channels)."""
    _, u, y = next(stream.pieces(length, step, step))
    return np.hstack([u, y])[:length]
