"""Random tables over the whole space of questions; `benchmarks/strangers.py` runs 200 of them.

A table has 10 to 300 rows, up to 5 series and 10 groups of noise, any observables and any closure. Held are
the optimum against local searches, the exact posterior against importance sampling from other proposals, and
the memory.
"""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from strangers import Errors, draw, errors_of

from ifrfit.errors import IfrfitError

QUICK = 4
BELOW_PROVEN = 0.05  # of -2 log L: the gap of a certificate over unknown noises is 1e-4
MEAN, SD = 0.15, 0.15  # posterior sd; importance sampling with 400 effective draws errs by 0.05
MOST = 2**30  # bytes


def answered(number: int, path) -> Errors | None:
    """None where the question is refused."""
    table = draw(1, number)
    path.write_text(table.text, encoding="utf-8")
    tracemalloc.start()
    try:
        return errors_of(table.problem(path), searches=4, draws=6000)
    except IfrfitError:
        return None
    finally:
        assert tracemalloc.get_traced_memory()[1] < MOST
        tracemalloc.stop()


def check(number: int, path) -> None:
    errors = answered(number, path)
    if errors is None:
        return
    assert not errors.proven or errors.missed < BELOW_PROVEN
    if np.isfinite(errors.mean):
        assert errors.mean < MEAN
        assert errors.sd < SD


@pytest.mark.parametrize("number", range(QUICK))
def test_answers_of_random_tables_stand(number, tmp_path):
    check(number, tmp_path / "table.csv")


@pytest.mark.long
@pytest.mark.parametrize("number", range(QUICK, 60))
def test_answers_of_many_random_tables_stand(number, tmp_path):
    check(number, tmp_path / "table.csv")
