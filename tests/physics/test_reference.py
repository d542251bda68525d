"""All rows of tests/reference/impacts.csv, to the tolerances stated in the README beside it."""

from __future__ import annotations

import numpy as np
from reference_impacts import cancelling, columns, misses, rebounds


def test_every_row_is_met() -> None:
    assert len(columns()["tag"]) == 440
    assert cancelling(columns()).sum() == 1
    assert misses(columns()) == []


def test_regimes() -> None:
    rows = columns()
    tag, regime = rows["tag"].astype(str), rows["regime"].astype(str)
    clear = ~np.char.startswith(tag, "transition") & (tag != "Ut_zero") & (regime != "none")
    assert clear.sum() > 400
    wrong = rebounds(rows).sticking[clear] != (regime[clear] == "sticking")
    assert tag[clear][wrong].tolist() == []


def test_a_wrong_coefficient_would_be_seen() -> None:
    """Negative control: the contact form of the friction in sticking is another model."""
    wrong = misses(columns(), "ifr-contact")
    assert sum(line.startswith("v_x,") for line in wrong) > 100
