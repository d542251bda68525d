"""Leave-one-impact-out by smoothed weights against exact refits without the impact."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from comparison_data import observations
from factories import problem_of

from ifrfit.inference.comparison import compare
from ifrfit.inference.comparison.compare import _weighed
from ifrfit.inference.comparison.loo import left_out, loo_of, with_differences
from ifrfit.inference.comparison.result import HOPELESS
from ifrfit.inference.fit import fit
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.posterior import integrate, log_evidence

SEED = np.random.SeedSequence(5)


@pytest.mark.parametrize("noise", ["known", "unknown"])
def test_smoothed_weights_agree_with_refits(noise):
    data = observations("ifr", np.linspace(5, 80, 12), sigma=0.05, e_t=-0.85, seed=2)
    result = fit(data, fix={"e_n": 0.9}, noise=noise)
    found = loo_of(result, SEED)
    density = Density(result.problem)
    exact = [
        left_out(result.problem, result.distribution.log_evidence, density.impact != i) for i in range(12)
    ]
    assert found.pareto_k.shape == (12,)
    assert found.n_draws == 4000
    for i in range(12):
        # the error of smoothed weights grows with k
        assert found.pointwise[i] == pytest.approx(exact[i], abs=0.02 if found.pareto_k[i] < 0.3 else 0.15)
    assert found.elpd == pytest.approx(sum(exact), abs=0.15)
    assert found.se == pytest.approx(math.sqrt(12 * np.var(found.pointwise, ddof=1)))
    assert 0.5 < found.p_loo < 5.0


def test_left_out_is_the_ratio_of_evidences_by_hand():
    data = observations("ifr", [5.0, 8.0, 11.0], sigma=0.1, e_t=-0.7, mu=0.5)
    problem = problem_of(data, "fr", fix={"e_n": 0.9, "mu": 0.5})
    keep = np.array([True, True, False])
    found = left_out(problem, log_evidence(problem), keep)
    # sticking, far from the bounds: the third value is predicted by a normal law about the mean of the others
    value = data.table["value"].to_numpy()
    sd = 0.1 * math.sqrt(1.0 + 1.0 / 2.0)
    z = (value[2] - value[:2].mean()) / sd
    assert found == pytest.approx(-0.5 * z * z - math.log(sd * math.sqrt(2.0 * math.pi)), abs=1e-3)


def test_an_outlier_is_refitted_and_the_rest_is_not():
    data = observations("ifr", np.linspace(5, 80, 10), sigma=0.05, e_t=-0.85, seed=2)
    table = data.table
    table.loc[4, "value"] += 0.6
    result = fit(type(data)(table, data.sources), fix={"e_n": 0.9}, noise="known")
    found = loo_of(result, SEED)
    assert found.refitted == ("line 5",)
    assert found.doubtful == ()
    assert found.pareto_k[4] > found.threshold
    keep = np.arange(10) != 4
    assert found.pointwise[4] == pytest.approx(
        left_out(result.problem, result.distribution.log_evidence, keep)
    )
    small = np.delete(found.pareto_k, 4)
    assert (small <= found.threshold).all()


def test_no_impact_is_left_out_in_earnest_under_a_closure_without_hope():
    data = observations("ifr", np.linspace(5, 80, 20), sigma=0.01, e_t=-0.6, seed=2)
    found = compare(data, closures=["ifr", "f"], fix={"e_n": 0.9})
    assert found.entries["f"].log_bayes_factor < -HOPELESS
    own = found.entries["f"].loo
    assert own.doubtful
    assert own.refitted == ()
    assert own.difference < -HOPELESS
    assert "is not to be trusted" not in found.summary()
    # alone it is left out
    assert loo_of(found.entries["f"].fit, SEED).refitted


def test_rows_of_an_impact_are_left_out_together():
    ids = np.array([f"i{k}" for k in range(8)])
    data = observations(
        "ifr", np.linspace(8, 78, 8), ("beta_cm", "spin_y_after"), sigma=0.03, e_t=-0.85, impact_id=ids
    )
    result = fit(data, fix={"e_n": 0.9}, noise="known")
    found = loo_of(result, SEED)
    assert found.impacts == tuple(f"impact i{k}" for k in range(8))
    keep = data.table["impact_id"].to_numpy() != "i3"
    assert keep.sum() == 14
    exact = left_out(result.problem, result.distribution.log_evidence, keep)
    assert found.pointwise[3] == pytest.approx(exact, abs=0.1)
    # rows one by one would say something else
    rows = loo_of(fit(observations(
        "ifr", np.linspace(8, 78, 8), ("beta_cm", "spin_y_after"), sigma=0.03, e_t=-0.85
    ), fix={"e_n": 0.9}, noise="known", independent=True), SEED)  # fmt: skip
    assert rows.pointwise.size == 16


def test_rows_that_no_constant_moves_are_exact():
    """Closure F gives 0 to every sticking row: their weights are all the same."""
    data = observations("f", [4.0, 6.0, 40.0, 60.0, 80.0], sigma=0.05)
    found = loo_of(fit(data, closure="f", fix={"e_n": 0.9}, noise="known"), SEED)
    value = data.table["value"].to_numpy()
    for i in (0, 1):
        expected = -0.5 * (value[i] / 0.05) ** 2 - math.log(0.05 * math.sqrt(2.0 * math.pi))
        assert found.pareto_k[i] == -math.inf
        assert found.pointwise[i] == pytest.approx(expected, abs=1e-9)
    assert np.isfinite(found.pareto_k[2:]).all()


def test_differences_are_taken_impact_by_impact():
    data = observations("ifr", sigma=0.05, e_t=-0.7)
    found = {
        name: loo_of(fit(data, closure=name, fix={"e_n": 0.9}, noise="known"), SEED) for name in ("fr", "ifr")
    }
    both = with_differences(found)
    gap = both["fr"].pointwise - both["ifr"].pointwise
    assert both["ifr"].difference == 0.0
    assert both["fr"].difference == pytest.approx(gap.sum())
    assert both["fr"].se_difference == pytest.approx(math.sqrt(gap.size * gap.var(ddof=1)))
    assert both["fr"].se_difference < both["fr"].se  # the impacts are the same: much of the scatter cancels


def test_draws_do_not_depend_on_what_else_is_compared():
    data = observations("ifr", sigma=0.05, e_t=-0.85)
    two = compare(data, ("fr", "ifr"), fix={"e_n": 0.9}, noise="known")
    three = compare(data, ("ifr", "f", "fr"), fix={"e_n": 0.9}, noise="known")
    other = compare(data, ("fr", "ifr"), fix={"e_n": 0.9}, noise="known", seed=1)
    assert (two.entries["ifr"].loo.pointwise == three.entries["ifr"].loo.pointwise).all()
    assert (two.entries["ifr"].loo.pointwise != other.entries["ifr"].loo.pointwise).any()


def test_too_many_rows_are_said(monkeypatch):
    monkeypatch.setattr("ifrfit.inference.comparison.loo._LARGEST", 1000 * 25 - 1)
    found = compare(observations("ifr", sigma=0.05, e_t=-0.85), ("f", "ifr"), fix={"e_n": 0.9})
    assert all(entry.loo is None for entry in found.entries.values())
    assert any("Too many rows for cross-validation" in note for note in found.notes)


def test_refits_keep_the_prior_of_the_noise():
    """The largest value sets the scale of the noise's prior: leaving it out must not change that prior."""
    data = observations("ifr", np.linspace(5, 80, 8), ("tan_psi_after",), sigma=0.05, e_t=-0.85, given=False)
    result = fit(data, fix={"e_n": 0.9})
    density = Density(result.problem)
    largest = int(np.argmax(np.abs(data.table["value"].to_numpy())))
    found = left_out(result.problem, integrate(result.problem).log_evidence, density.impact != largest)
    smoothed = loo_of(result, SEED)
    assert found == pytest.approx(smoothed.pointwise[largest], abs=0.15)


def test_a_closure_without_a_number_leaves_the_others_theirs(monkeypatch):
    data = observations("ifr", sigma=0.05, e_t=-0.85)
    whole = compare(data, ("f", "fr", "ifr"), fix={"e_n": 0.9}, noise="known")

    def lossy(fit, seed, **choices):
        found = loo_of(fit, seed, **choices)
        if fit.closure != "fr":
            return found
        pointwise = found.pointwise.copy()
        pointwise[2] = math.nan
        return replace(found, pointwise=pointwise, elpd=math.nan)

    monkeypatch.setattr(sys.modules[_weighed.__module__], "loo_of", lossy)
    found = compare(data, ("f", "fr", "ifr"), fix={"e_n": 0.9}, noise="known")
    assert found.entries["fr"].loo is None
    for name in ("f", "ifr"):
        assert found.entries[name].loo.elpd == whole.entries[name].loo.elpd
        assert math.isfinite(found.entries[name].loo.difference)
    note = next(note for note in found.notes if "gives no number" in note)
    assert note.startswith("Cross-validation of FR gives no number: by its draws line ")
    text = found.summary()
    assert "nan" not in text
    assert "leave-one-impact-out" in text
    assert "gives no number" in text
    found.plot()
    assert "nan" not in found._repr_html_()
