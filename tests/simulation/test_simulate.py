"""Simulations: from a scene to a table that a fit reads back, and from a fit to a scene."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from factories import exchanged
from json_schemas import validator

import ifrfit
from ifrfit.errors import DataError, UsageError
from ifrfit.physics import OBSERVABLES
from ifrfit.physics.effects import EFFECTS, compose
from ifrfit.physics.effects.plan import differences
from ifrfit.physics.scenes import read_scene
from ifrfit.physics.scenes.reading import AXES
from ifrfit.simulation.simulate import simulate

EXAMPLES = sorted((Path(__file__).parents[2] / "docs" / "scenes").glob("*.toml"))
SCENE = """\
observables = ["e_n", "beta"]

[sphere]
diameter_mm = 20

[impact]
gamma_deg = { from = 5, to = 85, count = 33 }
speed_m_s = 2.0

[constants]
e_n = 0.9
e_t = -0.9
mu = 0.15
"""


@pytest.fixture
def scene(tmp_path: Path) -> Callable[..., Path]:
    def save(*exchanges: tuple[str, str]) -> Path:
        path = tmp_path / "scene.toml"
        path.write_text(exchanged(SCENE, *exchanges), encoding="utf-8")
        return path

    return save


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_drop_less_than_they_say(path):
    """All effects that could be computed, against the plan, on every impact of the scene."""
    found = simulate(path, samples=None if not read_scene(path).random else 20)
    plan = found.plan
    forced = [line.effect for line in plan.lines if line.state in ("on", "off")]
    change = differences(
        compose(found.contact, found.impacts, forced),
        found.outcome,
        found.impacts.mu,
        found.scene.observables,
    )
    assert max(change.values()) <= plan.accuracy
    assert (np.asarray(found.outcome.energy_change) <= 1e-12).all()
    assert len(EXAMPLES) == 6


def test_examples_call_for_what_they_stand_for():
    on = {path.stem: simulate(path, samples=3).plan.on for path in EXAMPLES}
    assert on["lateral-spin"] == ("lateral-spin",)
    assert on["table-tennis"] == ("lateral-spin",)
    assert on["dust"] == ("plasticity",)
    assert on["fine-glass"] == ("adhesion",)
    assert on["wet-bead"] == ("fluid",)
    assert "rolling" in on["kharaz"]


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_fit_reads_it_back_and_recovers_the_constants(scene, tmp_path, noise):
    exchange = ("[sphere]", f"[noise]\ne_n = {noise}\nbeta = {noise}\n\n[sphere]")
    found = simulate(scene(*([exchange] if noise else [])), seed=3)
    path = tmp_path / "rebounds.csv"
    found.rebounds().to_csv(path, index=False)
    fit = ifrfit.fit(path, method="lsq")
    assert fit.noise.policy == "known"
    assert fit.facts["lack_of_fit"].ok
    assert fit.inputs[0].provenance == "simulated"
    for name, truth in (("e_n", 0.9), ("e_t", -0.9), ("mu", 0.15)):
        estimate = fit.constants[name]
        assert estimate.value == pytest.approx(truth, abs=4.0 * estimate.stderr + 1e-9), name
    if not noise:
        assert fit.constants["mu"].value == pytest.approx(0.15, abs=1e-9)


def test_another_truth_is_recovered_as_another(scene, tmp_path):
    """Control: the comparison above can fail."""
    simulate(scene(("mu = 0.15", "mu = 0.2"))).rebounds().to_csv(tmp_path / "r.csv", index=False)
    assert ifrfit.fit(tmp_path / "r.csv", method="lsq").constants["mu"].value == pytest.approx(0.2, abs=1e-9)


def test_captured_impacts_give_e_n_zero_and_nothing_else(tmp_path):
    path = next(path for path in EXAMPLES if path.stem == "fine-glass")
    found = simulate(path)
    table, captured = found.rebounds(), found.outcome.captured
    assert captured.any()
    for name in found.scene.observables:
        value = table.loc[table["observable"] == name, "value"].to_numpy()
        if name == "e_n":
            assert (value[captured] == 0.0).all()
        else:
            assert np.isnan(value[captured]).all()
    impacts = found.table()
    assert list(impacts["outcome"] == "captured") == list(captured)
    assert (impacts.loc[captured, "v_n"] == 0.0).all()
    table.to_csv(tmp_path / "r.csv", index=False)
    read = ifrfit.read(tmp_path / "r.csv")
    assert read.sources[0].rows_skipped["not measured"] >= 2 * captured.sum()


def test_the_posterior_is_propagated(scene, tmp_path):
    data = tmp_path / "data.csv"
    noisy = scene(("[sphere]", "[noise]\ne_n = 0.02\nbeta = 0.03\n\n[sphere]"))
    simulate(noisy, seed=1).rebounds().to_csv(data, index=False)
    fit = ifrfit.fit(data, method="lsq", noise="known")
    fit.save(tmp_path / "result.json")
    path = scene(("e_n = 0.9\ne_t = -0.9\nmu = 0.15", 'result = "result.json"'))
    found = simulate(path, samples=4000, seed=2)
    assert found.closure == "ifr"
    curves = found.curves()
    mine = curves[curves["observable"] == "beta"]
    theirs = fit.predict(mine["gamma_deg"], observable="beta")
    width = (theirs["hi68"] - theirs["lo68"]).to_numpy()
    for column in ("lo68", "hi68"):
        gap = np.abs(mine[column].to_numpy() - theirs[column].to_numpy())
        assert (gap <= 0.12 * width + 1e-12).all(), column


def test_a_stand_in_behind_the_constants_is_said(scene, tmp_path):
    ifrfit.fit("cross-2019", fix={"e_n": 0.94}, method="lsq").save(tmp_path / "result.json")
    path = scene(("e_n = 0.9\ne_t = -0.9\nmu = 0.15", 'result = "result.json"'))
    found = simulate(path, samples=5)
    assert "STAND-IN" in found.notes[0]
    assert "STAND-IN" in found.summary()
    assert "STAND-IN" in json.dumps(found.to_dict())


def test_constants_the_fit_leaves_open_are_said(scene, tmp_path):
    ifrfit.fit("kharaz-2001", method="lsq").save(tmp_path / "result.json")
    path = scene(("e_n = 0.9\ne_t = -0.9\nmu = 0.15", 'result = "result.json"'))
    assert any("does not determine" in note for note in simulate(path, samples=5).notes)


def test_separate_constants_need_a_series(scene, tmp_path):
    ifrfit.fit(
        "cross-2019", series=["no spin", "spin 0.225"], separate="mu", fix={"e_n": 0.94}, method="lsq"
    ).save(tmp_path / "result.json")
    plain = ("e_n = 0.9\ne_t = -0.9\nmu = 0.15", 'result = "result.json"')
    with pytest.raises(DataError, match=r"Name one of no spin, spin 0\.225"):
        simulate(scene(plain), samples=5)
    named = (plain[0], 'result = "result.json"\nseries = "spin 0.225"')
    assert simulate(scene(named), samples=5).impacts.mu.mean() == pytest.approx(0.14, abs=0.03)


def test_another_inertia_than_the_fit_is_refused(scene, tmp_path):
    ifrfit.fit("cross-2019", fix={"e_n": 0.94}, method="lsq").save(tmp_path / "result.json")
    path = scene(
        ("e_n = 0.9\ne_t = -0.9\nmu = 0.15", 'result = "result.json"'),
        ("diameter_mm = 20", "diameter_mm = 20\ninertia_factor = 0.6667"),
    )
    with pytest.raises(DataError, match=r"scene.toml: sphere.inertia_factor is 0.6667, but the fit"):
        simulate(path, samples=5)


def test_whatever_is_written_can_be_read(scene, tmp_path):
    """Every observable, at the angles and spins where some of them have no value."""
    names = [name for name in OBSERVABLES if name != "mu"]
    path = scene(
        ('["e_n", "beta"]', json.dumps(names)),
        ("gamma_deg = { from = 5, to = 85, count = 33 }", "gamma_deg = [0, 45, 90]"),
        ("speed_m_s = 2.0", "speed_m_s = 2.0\nspin_y = [-1, 0, 0.5]"),
    )
    table = simulate(path).rebounds()
    table.to_csv(tmp_path / "r.csv", index=False)
    read = ifrfit.read(tmp_path / "r.csv")
    assert len(read) == table["value"].notna().sum() > 80
    assert read.provenance == ("simulated",)


def test_a_captured_impact_has_no_noise(scene):
    path = scene(
        ("diameter_mm = 20", 'diameter_nm = 100\nmaterial = "granite"\n[wall]\nmaterial = "granite"'),
        ("[constants]", "[noise]\ne_n = 0.1\n[contact]\ninterface_energy_J_m2 = 1\n[constants]"),
    )
    found = simulate(path)
    table = found.rebounds()
    assert found.outcome.captured.all()
    assert (table.loc[table["observable"] == "e_n", "value"] == 0.0).all()


def test_the_seed_decides_and_nothing_else(scene):
    path = scene(("speed_m_s = 2.0", "speed_m_s = { mean = 2.0, sd = 0.5 }\nspin_y = { low = -1, high = 1 }"))
    one, two, other = (simulate(path, samples=7, seed=seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(one.outcome.v_x, two.outcome.v_x)
    assert (one.outcome.v_x != other.outcome.v_x).all()
    assert one.outcome.v_x.size == 33 * 7
    assert simulate(path).samples == 200
    assert simulate(scene()).samples == 1


def test_angles_stand_in_the_table_as_they_were_asked_for(scene):
    table = simulate(scene()).rebounds()
    assert list(table["gamma_deg"][:33]) == [5.0 + 2.5 * i for i in range(33)]


def test_too_many_impacts_are_refused_before_they_are_made(scene):
    with pytest.raises(UsageError, match=r"33 grid points with 100000 samples each are more than 2000000"):
        simulate(scene(), samples=100_000)
    huge = scene(
        ("count = 33", "count = 100000"),
        ("speed_m_s = 2.0", "speed_m_s = { from = 1, to = 2, count = 100000 }"),
    )
    with pytest.raises(UsageError, match=r"10000000000 grid points with 1 samples"):
        simulate(huge)


def test_contradictions_name_the_scene(scene):
    with pytest.raises(DataError, match=r"^scene.toml: constants.e_n is missing, and nothing computes it"):
        simulate(scene(("e_n = 0.9\n", "")))
    with pytest.raises(DataError, match=r"^scene.toml: constants.e_t is missing, and compliance cannot"):
        simulate(scene(("e_t = -0.9\n", "")))


def test_the_json_says_what_it_is(scene):
    content = simulate(scene()).to_dict()
    assert content["schema"] == "ifrfit/simulation/1"
    assert content["provenance"] == "simulated"
    assert content["outcomes"] == {"impacts": 33, "captured": 0, "sticking": content["outcomes"]["sticking"]}
    assert len(content["plan"]["effects"]) == len(EFFECTS)
    assert len(content["curves"]) == 66


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_simulation_json_meets_its_schema(path):
    schema = validator("simulation")
    content = simulate(path, samples=3).to_dict()
    schema.validate(content)
    assert json.loads(json.dumps(content, allow_nan=False)) == content
    assert set(AXES) <= set(schema.schema["$defs"]["curve_point"]["properties"])
    for key, value in (("schema", "ifrfit/simulation/2"), ("plan", {}), ("curves", [{}]), ("extra", 1)):
        assert not schema.is_valid(content | {key: value}), key
