"""The short version of ``benchmarks/oracle.py``: random plants against fifty digits."""

import mpmath
import pytest


@pytest.fixture(scope="module")
def oracle(benchmarks):
    import oracle

    return oracle


@pytest.mark.study
def test_random_plants_against_fifty_digits(oracle):
    rows = [oracle.one(case) for case in range(20_000, 20_045)]
    assert len({row["kind"] for row in rows}) >= 6
    for row in rows:
        known = [row[k] for k in ("matrices", "response", "derivative") if row[k] == row[k]]
        assert max(known) < oracle.WANTED or row["told"] >= oracle.VISIBLE
    assert sum(row["told"] >= oracle.VISIBLE for row in rows) <= 5


def test_the_oracle_sees_a_wrong_digit(oracle):
    assert oracle._apart(1 + 1e-10, mpmath.matrix([[1]])) > oracle.WANTED
