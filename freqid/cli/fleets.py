"""Many files, and the engine that fits them."""

from __future__ import annotations

import glob
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from freqid.checks import InputError


def matching(patterns: Sequence[str]) -> list[str]:
    """Files of names and patterns, in order; ValueError for one that matches none."""
    found: list[str] = []
    for pattern in patterns:
        if Path(pattern).is_dir():
            raise InputError(f"{pattern} is a folder; give its files, as in '{pattern}/**/*.csv'")
        some = [pattern] if Path(pattern).is_file() else sorted(glob.glob(pattern, recursive=True))
        if not some:
            raise InputError(f"{pattern} matches no file; check the pattern, in quotes")
        found += [s for s in some if s not in found]
    return found


@contextmanager
def engine(scheduler: str | None) -> Iterator[None]:
    """Work goes to the workers of a Dask scheduler where there is one."""
    if scheduler is None:
        yield
        return
    try:
        import joblib
        from dask.distributed import Client
    except ImportError:
        raise InputError("--scheduler needs dask; pip install 'freqid[dask]'") from None
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {scheduler} cannot be reached ({error})") from None
    with client, joblib.parallel_config(backend="dask"):
        yield
