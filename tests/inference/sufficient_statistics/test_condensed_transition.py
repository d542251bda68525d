"""Very many impacts that leave open where the transition lies stand together, provably with no difference."""

from __future__ import annotations

import numpy as np
import pytest
from streams import folder_of, impacts

import ifrfit
from ifrfit.errors import DataError
from ifrfit.inference.sufficient_statistics import (
    accumulated,
    condensed_transition,
    stream_fit,
    transition_window,
)

pytest.importorskip("numba")


def open_impacts(n, sigma, **options):
    """Impacts whose tangential values scatter widely."""
    table = impacts(n, sigma=0.03, **options)
    rng = np.random.default_rng(1)
    table["sigma_beta"] *= sigma / 0.03
    table["beta"] += table["sigma_beta"] * rng.standard_normal(n)
    return table


def as_if_many(monkeypatch, rows=300):
    """As if no more values could be held; gives what was solved."""
    monkeypatch.setattr(transition_window, "MOST_ROWS", rows)
    found = []
    solve = stream_fit.solve_condensed

    def seen(*given):
        found.extend(solve(*given))
        return found

    monkeypatch.setattr(stream_fit, "solve_condensed", seen)
    return found


@pytest.mark.parametrize(
    ("noise", "options"),
    [("known", {}), ("unknown", {"separate": ["mu"]}), ("known", {"closure": "fr"})],
)
def test_it_is_the_fit_of_impacts_that_are_held(tmp_path, monkeypatch, noise, options):
    # of which none is looked at by itself, that takes long
    monkeypatch.setattr(stream_fit, "_sample", lambda *given: DataError("none looked at."))
    table = open_impacts(8000, 1.0, series=2 if "separate" in options else 1)
    folder = folder_of(tmp_path / "all", table, 2, "parquet")
    held = ifrfit.fit(folder, method="exact", noise=noise, **options)
    solved = as_if_many(monkeypatch)
    found = ifrfit.fit(folder, method="exact", noise=noise, **options)
    (one,) = solved
    assert 0.0 < one.error <= condensed_transition._LARGEST_ERROR
    assert any("stand together in" in said for said in found.warnings)
    # a mean moves by half of the error in sd at most, beside what the quadratures leave open
    room = 0.5 * one.error + 2e-4
    for name, estimate in held.flat_constants().items():
        own = found.flat_constants()[name]
        assert own.status == estimate.status
        assert abs(own.value - estimate.value) < room * estimate.stderr, name
        np.testing.assert_allclose(own.interval95, estimate.interval95, rtol=0.0, atol=5e-3 * estimate.stderr)
    assert abs(found.fit.chi2 - held.fit.chi2) <= one.error + 1e-9 * held.fit.chi2
    gap, theirs = (of.facts["global_optimum"].figures["gap"] for of in (found, held))
    assert gap == pytest.approx(theirs + 2.0 * one.error, abs=1e-6)


@pytest.mark.parametrize("noise", ["known", "unknown"])
def test_the_bound_holds_of_every_transition(tmp_path, monkeypatch, noise):
    # the value of all rows in memory, at constants all over the region, less that of the sums
    monkeypatch.setattr(condensed_transition, "_LARGEST_ERROR", 1.0)  # so that there is something to see
    table = open_impacts(4000, 1.0, spin=0.0)
    table.to_parquet(tmp_path / "all.parquet")
    problem = ifrfit.fit(tmp_path / "all.parquet", method="lsq", noise=noise).problem
    solved = as_if_many(monkeypatch, 100)
    ifrfit.fit(folder_of(tmp_path / "all", table, 2, "parquet"), method="lsq", noise=noise)
    (one,) = solved
    best = one.optimum.optimum.theta
    at_best = one.question.value(one.problem, best)
    rng = np.random.default_rng(0)
    seen = 0.0
    names = one.problem.parameters.names
    assert names == problem.parameters.names
    for _ in range(4000):
        theta = best * (1.0 + np.array([0.002, 0.3, 0.3]) * rng.standard_normal(3))
        theta[names.index("e_t")] = np.clip(theta[names.index("e_t")], -1.0, -0.4)
        ours = one.question.value(one.problem, theta)
        if ours - at_best < transition_window.FAR:
            seen = max(seen, abs(ours - one.question.value(problem, theta)))
    assert 1e-6 < seen <= one.error


def test_rows_at_one_angle_need_no_narrow_intervals(tmp_path, monkeypatch):
    table = open_impacts(6000, 1.0, spin=0.0)
    table["gamma_deg"] = np.round(table["gamma_deg"] / 5.0) * 5.0
    table = table[(table["gamma_deg"] > 0.0) & (table["gamma_deg"] < 90.0)]
    solved = as_if_many(monkeypatch)
    found = ifrfit.fit(folder_of(tmp_path / "all", table, 2, "parquet"), method="lsq")
    assert found.facts["global_optimum"].ok
    assert len(solved[0].problem.rows) < 100


def test_what_even_narrow_intervals_leave_open_is_refused(tmp_path, monkeypatch):
    as_if_many(monkeypatch)
    monkeypatch.setattr(condensed_transition, "MOST_SUMS", 4100)
    folder = folder_of(tmp_path / "all", open_impacts(3000, 3.0), 2, "parquet")
    with pytest.raises(DataError, match=r"leave open where sliding ends, so much that 4,100 sums.*by series"):
        ifrfit.fit(folder)


def test_many_series_have_fewer_intervals(tmp_path, monkeypatch):
    table = impacts(4000, series=4)
    folder = folder_of(tmp_path / "all", table.sort_values("series"), 4, "parquet")
    held = ifrfit.fit(folder, method="lsq")
    monkeypatch.setattr(accumulated, "MOST_SUMS", 9000)
    monkeypatch.setattr(stream_fit, "MOST_SUMS", 9000)
    monkeypatch.setattr(transition_window, "MOST_SUMS", 9000)
    most = []
    nothing = accumulated.Moments.nothing
    monkeypatch.setattr(
        accumulated.Moments,
        "nothing",
        lambda groups, bins: most.append(groups * bins) or nothing(groups, bins),
    )
    found = ifrfit.fit(folder, method="lsq")
    assert max(most) <= 9000
    for name, estimate in held.constants.items():
        assert found.constants[name].value == pytest.approx(estimate.value, rel=1e-11)
    for module in (accumulated, stream_fit):
        monkeypatch.setattr(module, "MOST_SUMS", 100)
    with pytest.raises(DataError, match=r"2 series times observables are too many.*ifrfit campaign"):
        ifrfit.fit(folder, method="lsq")
