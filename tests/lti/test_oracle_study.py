"""The short version of ``benchmarks/oracle.py``: random plants against fifty digits."""

import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def oracle():
    folder = Path(__file__).resolve().parents[2] / "benchmarks"
    sys.path.insert(0, str(folder))
    try:
        import oracle

        yield oracle
    finally:
        sys.path.remove(str(folder))


def test_random_plants_against_fifty_digits(oracle):
    rows = [oracle.one(case) for case in range(20_000, 20_012)]
    assert len({row["kind"] for row in rows}) >= 5
    for row in rows:
        known = [row[k] for k in ("matrices", "response", "derivative") if row[k] == row[k]]
        assert max(known) < oracle.WANTED


def test_the_oracle_sees_a_wrong_digit(oracle):
    import mpmath

    assert oracle._apart(1 + 1e-10, mpmath.matrix([[1]])) > oracle.WANTED
