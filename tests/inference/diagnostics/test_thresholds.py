"""The documented rules are those of the code, and every fact of a fit has one."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

import ifrfit
from ifrfit.inference.diagnostics.precedence import in_order
from ifrfit.inference.diagnostics.thresholds import FACTS, STATUSES

ROOT = Path(__file__).resolve().parents[3]


def test_the_page_is_up_to_date():
    page = runpy.run_path(str(ROOT / "scripts" / "write_statuses.py"))["page"]()
    assert (ROOT / "docs" / "statuses.md").read_text(encoding="utf-8") == page


def test_every_fact_and_status_has_its_rule(impacts):
    found = ifrfit.fit(impacts(gamma=np.linspace(5, 85, 20), noise=0.02), fix={"e_n": 0.94})
    assert set(found.facts) <= set(FACTS)
    for name, fact in found.facts.items():
        assert fact.threshold == FACTS[name]
        assert fact.says
    assert {e.status for e in found.flat_constants().values()} <= set(STATUSES)


def test_a_finding_without_a_place_is_not_left_out_in_silence(impacts):
    facts = ifrfit.fit(impacts(gamma=np.linspace(5, 85, 20), noise=0.02), fix={"e_n": 0.94}).facts
    with pytest.raises(ValueError, match="not in tuple"):
        in_order({"lack_of_fit": facts["lack_of_fit"], "unheard": facts["lack_of_fit"]})
