"""A sigma that is too small is doubted before the law is."""

from __future__ import annotations

import numpy as np
import pytest
from factories import at_most, impacts_file, rest_long, table_file

from ifrfit import compare, fit, read
from ifrfit.physics import rebound
from ifrfit.report.sentences import headline

ANGLES = np.linspace(8.0, 80.0, 30)
TABLES = 15


def _table(path, seed, sigma, **more):
    """beta and e_n with noises of 0.03 and 0.02."""
    beta = {"gamma": ANGLES, "noise": 0.03, "sigma": 0.03 * sigma, "seed": seed} | more
    e_n = {"gamma": ANGLES, "observables": ("e_n",), "noise": 0.02, "sigma": 0.02 * sigma, "seed": 100 + seed}
    return impacts_file(path, beta, e_n)


@pytest.mark.parametrize("times", [1.5, 3.0])
def test_a_sigma_that_is_too_small_is_named_before_the_law(tmp_path, times):
    first = []
    for seed in range(TABLES):
        facts = fit(_table(tmp_path / "t.csv", seed, 1.0 / times), method="lsq").facts
        first.append(next(name for name, fact in facts.items() if not fact.ok))
    # of two tests of a trend one fails by chance in a twentieth to a tenth of the tables
    assert first.count("scatter_too_large") >= TABLES - at_most(TABLES, 0.1)


def test_the_first_line_and_the_remedy(tmp_path):
    path = _table(tmp_path / "t.csv", 1, 0.5)
    result = fit(path)
    assert result.summary().startswith("LOOK  the data scatter more than their sigma")
    fact = result.facts["scatter_too_large"]
    assert fact.figures["factor"] == pytest.approx(2.0, rel=0.2)
    assert "--noise scaled takes its size from the scatter" in fact.says
    assert result.facts["lack_of_fit"].ok
    assert "scatter_too_large" not in fit(path, noise="scaled", method="lsq").facts


def test_sigma_of_one_observable_alone(tmp_path):
    beta = {"gamma": ANGLES, "noise": 0.03, "sigma": 0.01, "seed": 3}
    e_n = {"gamma": ANGLES, "observables": ("e_n",), "noise": 0.02, "sigma": 0.02, "seed": 4}
    says = fit(impacts_file(tmp_path / "t.csv", beta, e_n), method="lsq").facts["scatter_too_large"].says
    assert says.startswith("the values of beta scatter 3")
    assert "--noise unknown" in says


def test_series_that_differ_are_the_reason(tmp_path):
    parts = [
        {"gamma": ANGLES, "noise": 0.02, "sigma": 0.02, "mu": mu, "series": name, "seed": seed}
        for seed, (name, mu) in enumerate((("a", 0.10), ("b", 0.14)))
    ]
    facts = fit(impacts_file(tmp_path / "t.csv", *parts), method="lsq", fix={"e_n": 0.94}).facts
    assert "scatter_too_large" not in facts
    assert not facts["pooling"].ok


def test_a_right_sigma_is_none(tmp_path):
    for seed in range(TABLES):
        assert "scatter_too_large" not in fit(_table(tmp_path / "t.csv", seed, 1.0), method="lsq").facts


def test_another_law_is_a_lack_of_fit(tmp_path):
    """Walton's sphere under F, which has no restitution along the wall: a trend, whatever sigma is."""
    path = impacts_file(
        tmp_path / "t.csv", {"gamma": ANGLES, "noise": 0.01, "sigma": 0.01, "closure": "fr", "c": 0.5}
    )
    facts = fit(path, method="lsq", closure="f", fix={"e_n": 0.94}).facts
    assert "scatter_too_large" not in facts
    assert not facts["lack_of_fit"].ok


def test_neighbours_that_are_alike_are_no_scatter():
    """A law without tangential restitution, where five of twelve rows show one."""
    facts = fit("hashemnia-2019", closure="f", method="lsq").facts
    assert "scatter_too_large" not in facts
    assert not facts["lack_of_fit"].ok
    assert not facts["beyond_closure"].ok


def test_closures_are_not_refuted_for_a_sigma(tmp_path):
    found = compare(_table(tmp_path / "t.csv", 2, 0.5), ["f", "ifr"], loo=False).verdict
    assert found.kind == "refuted"
    assert "the law need not be the reason: the values scatter" in found.says
    assert "--noise scaled" in found.says


def test_outliers_that_hide_one_another_are_no_wide_scatter(tmp_path):
    """Four of thirty readings ten sigma off: at the noise of all together none stands out."""
    path = impacts_file(tmp_path / "t.csv", {"gamma": ANGLES, "noise": 0.02, "sigma": 0.02, "seed": 1})
    lines = path.read_text(encoding="utf-8").splitlines()
    for place, off in ((4, 0.2), (11, -0.2), (18, 0.2), (25, -0.2)):
        fields = lines[place].split(",")
        column = lines[0].split(",").index("value")
        fields[column] = f"{float(fields[column]) + off:.5f}"
        lines[place] = ",".join(fields)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    facts = fit(path, method="lsq", fix={"e_n": 0.94}).facts
    assert "scatter_too_large" not in facts
    assert len(facts["outliers"].figures["rows"]) == 4


def _of_beta(path, seed, noise, sigma):
    """beta with errors of a size, and a sigma that is a function of beta; in no order."""
    gamma = np.random.default_rng(0).permutation(np.linspace(5.0, 85.0, 40))
    beta = rebound(gamma, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True).beta
    beta = beta + noise(gamma) * np.random.default_rng(seed).standard_normal(40)
    columns = {"gamma_deg": gamma, "beta": beta, "beta_sigma": sigma(beta)}
    return fit(table_file(path, columns, "%.5f"), method="lsq", fix={"e_n": 0.9}).facts


def test_errors_of_one_size_with_a_sigma_in_proportion_to_the_value(tmp_path):
    """Rows near beta = 0 seem to have no errors, which looked like errors of the angles, or a drift."""
    first = []
    for seed in range(TABLES):
        facts = _of_beta(tmp_path / "t.csv", seed, lambda _: 0.02, lambda beta: 0.05 * np.abs(beta))
        first.append(next((name for name, fact in facts.items() if not fact.ok), ""))
        if first[-1] == "scatter_too_large":
            says = facts["scatter_too_large"].says
            assert "errors of one size, whatever the angle or the value, describe them better" in says
            assert "--noise unknown" in says
            assert not {"scatter_by_angle", "angle_scatter"} & facts.keys()
    assert first.count("scatter_too_large") > TABLES // 2
    assert first.count("slips") <= 1


def test_a_scatter_that_changes_with_the_angle_is_no_factor_on_sigma(tmp_path):
    found = 0
    for seed in range(TABLES):
        facts = _of_beta(
            tmp_path / "t.csv", seed, lambda gamma: 0.01 + 0.05 * (gamma / 85.0) ** 2, lambda _: 0.01
        )
        if {"scatter_by_angle", "scatter_too_large"} <= facts.keys():
            found += 1
            says = facts["scatter_by_angle"].says
            assert "with these sizes in the place of the sigma that is given" in says
            assert "--noise" not in facts["scatter_too_large"].says
    assert found > TABLES // 5


@pytest.mark.parametrize("seed", rest_long(range(24), 4))
def test_a_few_rows_far_off_are_no_sigma_that_is_too_small(tmp_path, seed):
    rng = np.random.default_rng(seed)
    gamma = np.sort(rng.uniform(5.0, 80.0, 33))
    beta = rebound(gamma, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True).beta + 0.02 * rng.standard_normal(33)
    beta[rng.choice(33, 3, replace=False)] += 0.02 * rng.uniform(8.0, 12.0, 3) * rng.choice([-1, 1], 3)
    path = table_file(tmp_path / "t.csv", {"gamma_deg": gamma, "beta": beta, "sigma": np.full(33, 0.02)})
    found = fit(path, fix={"e_n": 0.9}, method="lsq")
    assert "scatter_too_large" not in found.facts
    assert len(found.facts["outliers"].figures["rows"]) == 3
    assert found.facts["lack_of_fit"].says.startswith("the 3 outliers alone contradict the fit")
    assert headline(found) == "outliers"


def test_a_sigma_that_is_too_small_beside_readings_without_one(tmp_path):
    """Velocities with a sigma, and spins without."""
    named = []
    for seed in range(TABLES):
        rng = np.random.default_rng([seed, 9])
        state = rebound(ANGLES, e_n=0.9, e_t=-0.7, mu=0.15, degrees=True)
        columns = {"gamma_deg": ANGLES}
        for name, value in (("v_x", state.v_x), ("v_n", state.v_n), ("spin_y_after", state.spin_y)):
            columns[name] = value + 0.01 * rng.standard_normal(ANGLES.size)
        sigma = {f"sigma_{name}": np.full(ANGLES.size, 0.003) for name in ("v_x", "v_n")}
        result = fit(table_file(tmp_path / "t.csv", columns | sigma), method="lsq")
        if (fact := result.facts.get("scatter_too_large")) is not None:
            named.append(fact)
            assert headline(result) == "the data scatter more than their sigma"
            assert result.facts["outliers"].ok
    # of two tests of a trend one fails by chance in a twentieth to a tenth of the tables
    assert len(named) >= TABLES - at_most(TABLES, 0.1)
    assert all(fact.says.startswith("the values of v_x and v_n scatter ") for fact in named)
    assert np.mean([fact.figures["factor"] for fact in named]) == pytest.approx(3.3, rel=0.1)
    assert any("multiply it by 3" in fact.says and "--noise unknown" in fact.says for fact in named)


def test_uncertainties_of_angles_that_are_not_counted_are_named_first(tmp_path):
    path = _table(tmp_path / "t.csv", 1, 0.5)
    plain = fit(path, method="lsq").facts["scatter_too_large"].says
    assert "--angle-errors" not in plain
    table = read(path).table.assign(sigma_gamma_deg=0.5)
    says = fit(table, method="lsq").facts["scatter_too_large"].says
    assert "is not counted: try --angle-errors effective first, which counts it; --noise scaled" in says
