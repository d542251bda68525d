"""Profiles of impacts that are not held in memory: those of all rows, as far as they are drawn."""

from __future__ import annotations

import numpy as np
import pytest
from streams import folder_of, impacts

import ifrfit
from ifrfit.errors import DataError
from ifrfit.inference.appraise import appraise
from ifrfit.inference.profile.objective import Misfit
from ifrfit.inference.sufficient_statistics import stream_fit as stream_fit_module
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.inference.sufficient_statistics.transition_window import FAR, Question
from ifrfit.report import write_folder

pytest.importorskip("numba")

# of a 95 % interval, over its sd: its ends are known to 1e-8 of a bracket of at most two sd
TOLERANCE = 1e-7


@pytest.mark.parametrize(
    ("options", "table"),
    [
        ({"noise": "known"}, {}),
        ({"noise": "unknown"}, {"columns": ("v_x", "v_n"), "spin": 0.6}),
        ({"noise": "unknown", "separate": ("mu",)}, {"series": 2, "n": 400}),
        ({"closure": "f"}, {}),
        ({"bounds": {"mu": (0.1, 0.1501)}}, {}),
        ({"prior": {"e_n": (0.9, 0.01)}}, {"columns": ("beta",), "sigma": 0.5}),
    ],
    ids=str,
)
def test_profiles_are_those_of_all_rows(tmp_path, options, table):
    rows = impacts(**{"n": 1000, "seed": 3, **table})
    rows.to_csv(tmp_path / "all.csv", index=False)
    held = ifrfit.fit(tmp_path / "all.csv", method="profile", **options)
    streamed = ifrfit.fit(folder_of(tmp_path / "all", rows), method="profile", **options)
    assert streamed.problem is None
    assert list(streamed.profiles) == list(held.profiles)
    for name, theirs in held.profiles.items():
        ours = streamed.profiles[name]
        assert (ours.shape, ours.status, len(ours.pieces)) == (
            theirs.shape,
            theirs.status,
            len(theirs.pieces),
        )
        assert ours.dof == pytest.approx(theirs.dof, rel=1e-9)
        sd = theirs.stderr or 1.0
        np.testing.assert_allclose(ours.interval68, theirs.interval68, atol=TOLERANCE * sd)
        np.testing.assert_allclose(ours.interval95, theirs.interval95, atol=TOLERANCE * sd)
        same = np.isin(ours.x, theirs.x)  # places that both looked at
        at = np.searchsorted(theirs.x, ours.x[same])
        np.testing.assert_allclose(ours.rise[same], theirs.rise[at], atol=1e-6)
    assert streamed.facts["converged"].says == held.facts["converged"].says


@pytest.mark.parametrize("noise", ["known", "unknown"])
def test_beyond_the_window_all_rows_lie_above_the_proven_rise(tmp_path, monkeypatch, noise):
    """By all rows, at constants whose transition lies in every interval that is condensed."""
    found, least_rise = [], Question.least_rise

    def kept(question, problem, optimum, fetched):
        found.append((fetched, least_rise(question, problem, optimum, fetched)))
        return found[-1][1]

    monkeypatch.setattr(Question, "least_rise", kept)
    rows = impacts(1500, 5, sigma=0.1)
    rows.to_csv(tmp_path / "all.csv", index=False)
    ifrfit.fit(folder_of(tmp_path / "all", rows), method="profile", noise=noise)
    ((fetched, least),) = found
    assert least > 0.9 * FAR
    problem, optimum = ifrfit.fit(tmp_path / "all.csv", method="lsq", noise=noise).problem_and_optimum()
    misfit = Misfit.of(problem, optimum)
    tau = Intervals(fetched.shape[1]).edges
    outside = np.flatnonzero(~fetched[0] & (tau[:-1] > 0.0) & np.isfinite(tau[1:]))
    assert 100 < outside.size < fetched.size - 10
    rng = np.random.default_rng(0)
    law = problem.closure.law(problem.inertia_factor)
    e_n, e_t, mu = (problem.parameters.names.index(name) for name in ("e_n", "e_t", "mu"))
    theta = np.tile(optimum.optimum.theta, (outside.size * 20, 1))
    theta[:, e_t] += 0.1 * rng.standard_normal(len(theta))
    at = np.tile(np.sqrt(tau[outside] * tau[outside + 1]), 20)
    theta[:, mu] = at * law.bound(theta[:, e_t]) / (1.0 + theta[:, e_n])
    assert misfit.rises(theta).min() > least
    assert misfit.rises(optimum.optimum.theta[None])[0] == pytest.approx(0.0, abs=1e-9)


def test_what_the_sums_do_not_prove_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(Question, "least_rise", lambda *given: 5.0)
    folder = folder_of(tmp_path / "all", impacts(500), 2, "parquet")
    with pytest.raises(DataError, match=r"drawn to a rise of 8\.\d+, and the sums prove it only to 5"):
        ifrfit.fit(folder, method="profile")
    assert ifrfit.fit(folder, method="lsq").fit.n == 1000


def test_the_page_shows_the_profiles(tmp_path):
    folder = folder_of(tmp_path / "all", impacts(2200), 2, "parquet")
    fit = ifrfit.fit(folder, method="profile")
    assert fit.is_sampled
    appraisal = appraise(fit)
    assert list(appraisal.profiles) == list(fit.profiles)
    assert appraisal.without_profiles.endswith("were not held in memory: intervals are not compared.")
    write_folder(fit, appraisal, tmp_path / "out", force=False)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert 'id="profiles"' in page
    assert "intervals are not compared" in page


def test_an_answer_without_a_sample_has_no_spin_of_its_own(tmp_path, monkeypatch):
    folder = folder_of(tmp_path / "all", impacts(500), 2, "parquet")

    def refused(*given):
        raise DataError("a row is odd.")

    monkeypatch.setattr(stream_fit_module, "observe", refused)
    fit = ifrfit.fit(folder, method="lsq")
    assert any("Transition angles are those without spin" in said for said in fit.warnings)
    plain = ifrfit.fit(folder_of(tmp_path / "no", impacts(500).drop(columns="spin_y"), 2), method="lsq")
    assert not any("pin" in said for said in plain.warnings)
