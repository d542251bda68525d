"""A report is drawn from a result and its appraisal: nothing is fitted, profiled or integrated for it."""

from __future__ import annotations

import sys

import pytest

from ifrfit.inference.appraise import appraise
from ifrfit.inference.bootstrap import bootstrap
from ifrfit.inference.comparison.compare import compare_result
from ifrfit.inference.diagnostics.interval_comparison import intervals
from ifrfit.inference.fit import fit
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.optimize.solve import solve
from ifrfit.inference.posterior import integrate
from ifrfit.inference.profile.profile_all import profile_all
from ifrfit.report.page import assemble
from ifrfit.report.page.registries import FORMATS

SOLVERS = (bootstrap, compare_result, fit, integrate, intervals, least_squares, profile_all, solve)


@pytest.fixture
def _no_solver(monkeypatch):
    """Every solver raises, under every name it is imported by."""

    def fail(*_: object, **__: object) -> None:
        raise AssertionError("a solver was called")

    for name, module in list(sys.modules.items()):
        if name.startswith("ifrfit."):
            for attribute, value in list(vars(module).items()):
                if any(value is solver for solver in SOLVERS):
                    monkeypatch.setattr(module, attribute, fail)


@pytest.fixture(scope="module")
def appraised(results, compared):
    return results("fixed"), compared


@pytest.mark.usefixtures("_no_solver")
def test_a_report_is_drawn_without_a_solver(appraised):
    report = assemble(*appraised)
    assert {"closures", "profiles", "posterior", "identifiability"} <= {part.name for part in report.sections}
    # the formats write the same drawings
    files = FORMATS["html"].write(report, "drawn")
    assert next(iter(files)) == "drawn.html"
    assert all(files.values())


@pytest.mark.usefixtures("_no_solver")
def test_the_solvers_would_be_noticed(appraised):
    with pytest.raises(AssertionError, match="a solver was called"):
        appraise(appraised[0])


def test_the_intervals_are_those_of_the_result(appraised):
    result, appraisal = appraised
    assert appraisal.intervals.equals(result.intervals())
    assert set(appraisal.profiles) >= set(appraisal.intervals.index)
    assert len(appraisal.draws) == 2000
