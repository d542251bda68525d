"""The documented rules are those of the code, and every fact of a fit has one."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np

import ifrfit
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
