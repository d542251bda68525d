"""A fit whose posterior is sampled: its result, its words, its files, and the memory that it takes."""

from __future__ import annotations

import functools
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from factories import impacts_file
from refusals import refused
from simulated import simulated

import ifrfit
from ifrfit import Exact, UsageError
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import ImportancePosterior, QuadraturePosterior, importance_sampling
from ifrfit.inference.posterior.importance_sampling import EvidenceByImportance
from ifrfit.inference.posterior.integrators import exact_posterior, log_evidence, sampled_posterior
from ifrfit.physics.closure import Closure, ClosureConstant, rotational_share
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.registry import registered

GAMMA = np.linspace(6.0, 78.0, 16)
GIB = 2**30


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sampled") / "delta.csv"
    return impacts_file(
        path, {"gamma": GAMMA, "observables": ("delta_deg",), "noise": 0.5, "sigma": None, "seed": 1}
    )


@pytest.fixture(scope="module")
def sampled(table: Path) -> ifrfit.FitResult:
    return ifrfit.fit(table, seed=3)


def test_the_result_says_which_integrator_and_how_exact(sampled: ifrfit.FitResult) -> None:
    assert isinstance(sampled.distribution, ImportancePosterior)
    fact = sampled.facts["converged"]
    assert fact.ok
    assert fact.figures["integrator"] == "importance sampling"
    assert fact.figures["error"] == sampled.distribution.error
    assert 0.0 < fact.figures["error"] <= fact.figures["tolerance"]
    assert fact.figures["effective_draws"] >= 1000.0
    assert fact.says.startswith("posterior by importance sampling: standard errors of up to ")
    assert fact.says.split("\n")[0] in " ".join(sampled.summary().split())
    assert json.loads(json.dumps(sampled.to_dict()))["facts"]["converged"]["figures"]["error"] > 0.0


def test_it_answers_like_any_other(
    sampled: ifrfit.FitResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ifrfit.inference.estimations.TOLERANCE", 1e-3)  # what is compared holds to 0.05 sd
    by_grid = ifrfit.fit(sampled.problem.observations, method=Exact(integrator="quadrature"))
    assert not isinstance(by_grid.distribution, ImportancePosterior)
    assert "integrator" not in by_grid.facts["converged"].figures
    for name, own in by_grid.flat_constants().items():
        other = sampled.flat_constants()[name]
        assert own.status == other.status
        error = 0.05 * by_grid.distribution.sd(name)
        np.testing.assert_allclose(other.interval95, own.interval95, atol=4.0 * error)
    sampled.save(tmp_path / "result.json")
    read = ifrfit.load_result(tmp_path / "result.json")
    assert read.facts["converged"].says == sampled.facts["converged"].says
    gamma = [20.0, 50.0]
    bands = [each.predict(gamma, observable="beta")["value"] for each in (sampled, read, by_grid)]
    np.testing.assert_allclose(bands[0], bands[1])
    np.testing.assert_allclose(bands[0], bands[2], atol=0.02)
    assert sampled.intervals()["exact_low"].notna().all()


def test_the_same_seed_gives_the_same_result(sampled: ifrfit.FitResult, table: Path) -> None:
    again, other = (ifrfit.fit(table, seed=seed) for seed in (3, 4))
    assert again.fit.log_evidence == sampled.fit.log_evidence
    assert other.fit.log_evidence != sampled.fit.log_evidence


def test_integrators_that_do_not_exist_or_contradict_are_refused() -> None:
    with refused(UsageError, match="--integrator grid: choose automatic, quadrature, sampling"):
        Exact(integrator="grid")
    with refused(UsageError, match="integrator"):
        Exact(integrator="sampling", accuracy=1e-3)


def test_a_sampling_that_did_not_converge_says_so(table: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ifrfit.inference.posterior import integrators

    monkeypatch.setattr(importance_sampling, "SAMPLING_ERROR", 1e-9)
    monkeypatch.setattr(integrators, "_LAST_WORK", 1.0)
    fact = ifrfit.fit(table).facts["converged"]
    assert not fact.ok
    assert "importance sampling did not converge: standard errors of up to " in fact.says
    assert "--method mcmc" in fact.says


# numpy tells tracemalloc what it takes; the peak of the process would count that of the one which started it
FIT = """
import sys, tracemalloc, ifrfit
tracemalloc.start()
ifrfit.fit(sys.argv[1], closure="maw", separate=["mu"])
print(tracemalloc.get_traced_memory()[1])
"""


@pytest.mark.long
def test_a_grid_of_gigabytes_is_not_begun(tmp_path: Path) -> None:
    # 16 rows, four series with a friction and a noise of their own: quadrature took 31 s and 1.3 GB
    angles = (
        (12.0, 30.0, 47.0, 68.0),
        (15.0, 33.0, 52.0, 75.0),
        (8.0, 27.0, 44.0, 63.0),
        (20.0, 38.0, 55.0, 71.0),
    )
    parts = [
        {
            "gamma": np.array(own),
            "observables": ("beta_tot",),
            "noise": 0.02,
            "sigma": None,
            "seed": n,
            "series": f"s{n}",
        }
        for n, own in enumerate(angles)
    ]
    path = impacts_file(tmp_path / "table.csv", *parts)
    done = subprocess.run([sys.executable, "-c", FIT, str(path)], capture_output=True, text=True, check=True)
    assert float(done.stdout.split()[-1]) < GIB


def _never_converges(monkeypatch) -> None:
    """Every grid is too large, and no sample of it is to be believed."""
    from ifrfit.inference.posterior import integrators

    sampled = integrators.sampled_posterior

    def doubtful(*arguments, **choices):
        return replace(sampled(*arguments, **choices), error=1.0)

    monkeypatch.setattr(integrators, "_MOST_WORK", 1.0)
    monkeypatch.setattr(integrators, "_LAST_WORK", 1.0)
    monkeypatch.setattr(integrators, "_OF_EVIDENCE", 1.0)
    monkeypatch.setattr(integrators, "sampled_posterior", doubtful)
    monkeypatch.setattr(EvidenceByImportance, "evidence", lambda self: (0.0, np.inf))


def test_an_evidence_that_did_not_converge_is_not_told(tmp_path: Path, monkeypatch) -> None:
    path = impacts_file(
        tmp_path / "t.csv", {"gamma": np.linspace(5.0, 80.0, 14), "noise": 0.03, "sigma": 0.03}
    )
    problem = ifrfit.fit(path, fix={"e_n": 0.9}, method="lsq").problem
    assert np.isfinite(log_evidence(problem))
    _never_converges(monkeypatch)
    with refused(UsageError, match="did not converge"):
        log_evidence(problem)


def test_samples_that_did_not_converge_weigh_no_sharing(tmp_path: Path, monkeypatch) -> None:
    gamma = np.linspace(5.0, 80.0, 10)
    parts = [
        {"gamma": gamma, "noise": 0.03, "sigma": 0.03, "series": s, "seed": i} for i, s in enumerate("AB")
    ]
    path = impacts_file(tmp_path / "t.csv", *parts)
    question = {"fix": {"e_n": 0.9}, "separate": ["mu"]}
    assert "sharing" in ifrfit.fit(path, **question).facts
    _never_converges(monkeypatch)
    found = ifrfit.fit(path, **question)
    assert not found.facts["converged"].ok
    assert "sharing" not in found.facts


@pytest.mark.parametrize(
    ("of_quantiles", "tolerance"), [(9e-4, 1e-3), (4e-3, 5e-3), (9e-3, 1e-2), (2e-2, None)]
)
def test_a_grid_that_work_ends_says_the_error_of_its_quantiles(
    tmp_path, monkeypatch, of_quantiles, tolerance
):
    from ifrfit.inference.posterior import integrators, quadrature_posterior

    gamma = np.linspace(5.0, 80.0, 14)
    path = impacts_file(tmp_path / "t.csv", {"gamma": gamma, "noise": 0.03, "sigma": 0.03})
    problem = ifrfit.fit(path, fix={"e_n": 0.9}, method="lsq").problem
    ended = replace(integrators.exact_posterior(problem), errors=(8e-4,))
    monkeypatch.setattr(quadrature_posterior, "whole_error", lambda *arguments: of_quantiles)
    monkeypatch.setattr(integrators, "_small_grid", lambda *arguments: ended)
    found = integrators.exact_posterior(problem)
    if tolerance is None:
        assert isinstance(found, ImportancePosterior)
    else:
        assert found.converged
        assert (found.error, found.tolerance) == (of_quantiles, tolerance)


@pytest.mark.parametrize(("moved", "is_refused"), [(0.05, False), (0.5, True)])
def test_a_first_grid_that_leaves_no_room_for_another_is_laid_where_a_look_is_calm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moved: float, is_refused: bool
) -> None:
    from ifrfit.inference.posterior import adaptive_quadrature
    from ifrfit.inference.posterior.joint_grid import JointIntegral

    gamma = np.linspace(5.0, 80.0, 14)
    path = impacts_file(tmp_path / "t.csv", {"gamma": gamma, "noise": 0.03, "sigma": 0.03})
    problem = ifrfit.fit(path, method="lsq").problem
    work: list[float] = []
    drop = JointIntegral.drop_empty_panels

    def dropped(integral: JointIntegral, negligible: float) -> float:
        drop(integral, negligible)
        work.append(integral.work())
        return moved

    monkeypatch.setattr(JointIntegral, "drop_empty_panels", dropped)
    monkeypatch.setattr(adaptive_quadrature, "_OF_A_LOOK", 1.0)
    start = least_squares(problem)
    adaptive_quadrature.refuse_large(problem, 1e-4, start, 1e9)
    if is_refused:
        with pytest.raises(adaptive_quadrature.GridTooLargeError):
            adaptive_quadrature.refuse_large(problem, 1e-4, start, work[0] / 0.8)
    else:
        adaptive_quadrature.refuse_large(problem, 1e-4, start, work[0] / 0.8)
    adaptive_quadrature.refuse_large(problem, 1e-4, start, work[0] / 0.5)


def test_a_single_small_difference_of_two_rules_is_no_convergence() -> None:
    """FR at beta0 = -1, which one value 3e6 sigma below the closure's range calls for, knows no friction.

    The arm along mu is 1e-13 wide and holds nine tenths of the mass; a grid about the other sees none of it.
    """
    gamma = (75.0, 30.0, 15.0, 45.0, 15.0, 60.0, 30.0)
    beta = (4.18, 1.6, 4.98, 1.9, -0.533, -4.57, -4.68)
    sigma = (5.5e-4, 0.72, 0.049, 0.12, 2.1e-3, 0.45, 1.3e-6)
    found = ifrfit.fit(simulated("beta", gamma, beta, sigma), closure="fr", fix={"e_n": 0.94})
    assert not found.facts["converged"].ok


BLEND = Closure(
    name="blend",
    title="BLEND",
    law=lambda j: Coefficients(0.0, rotational_share(j), 2 * rotational_share(j), -2 * rotational_share(j)),
    source="made up: the impulse of sticking falls to that of a dead stop as w_b goes to 1",
    own=ClosureConstant("w_b", "w_b", "blend of full reversal and dead stop", lambda j: (0.0, 1.0)),
)


@functools.cache
def blended():
    """The problem of a closure that is registered while it is asked for, and its optimum."""
    problem = ifrfit.fit("cornell-glass", closure="blend", method="lsq").problem
    return problem, least_squares(problem)


def test_a_rare_tail_that_makes_most_of_a_variance_is_drawn_from():
    # a thousandth of the posterior lies far out in mu, where draws about the mode hardly come: a brute grid
    # over the constants gives mu an sd of 0.038, four times what a chain of 40,000 steps says
    with registered(BLEND):
        found = sampled_posterior(*blended())
    assert found.converged
    assert found.sd("mu") == pytest.approx(0.0382, rel=0.03)


def test_where_draws_do_not_converge_a_larger_grid_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ImportancePosterior, "converged", property(lambda _: False))
    with registered(BLEND):
        problem, start = blended()
        found = exact_posterior(problem, start=start)
    assert found.converged
    assert isinstance(found, QuadraturePosterior)
    assert found.sd("mu") == pytest.approx(0.0382, rel=0.02)
