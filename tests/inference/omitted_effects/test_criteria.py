"""The effects' criteria on the scene of the data, and what a result tells of them."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from json_schemas import validator

import ifrfit
from ifrfit.errors import DataError
from ifrfit.inference import load_result
from ifrfit.inference.appraisal import Appraisal
from ifrfit.inference.fit import fit
from ifrfit.physics.scenes import MATERIALS
from ifrfit.report.page.registries import SECTIONS
from ifrfit.report.page.report_input import ReportInput

TINY = """
[sphere]
diameter_um = 10
material = "soda-lime-glass"
[wall]
material = "soda-lime-glass"
[contact]
interface_energy_J_m2 = {energy}
rolling_friction = {rolling}
[fluid]
name = "air"
"""


@pytest.fixture(scope="module")
def kharaz():
    return fit("kharaz-2001", method="lsq")


@pytest.fixture
def tiny(tmp_path):
    def write(energy, rolling=1e-6):
        path = tmp_path / "tiny.toml"
        path.write_text(TINY.format(energy=energy, rolling=rolling))
        return path

    return write


def line(result, name):
    return next(one for one in result.effects if one.effect == name)


def test_numbers_of_kharaz_by_hand(kharaz):
    glass, alumina = MATERIALS["soda-lime-glass"], MATERIALS["alumina"]
    modulus = 1.0 / sum((1.0 - m.poisson**2) / m.young for m in (glass, alumina))
    # V_y = 1.5605 (p^5/(E*^4 rho))^(1/2) of a sphere on a plane
    v_y = 1.5605 * np.sqrt(glass.limiting_pressure**5 / (modulus**4 * alumina.density))
    fastest = 3.9 * np.cos(np.radians(kharaz.points["gamma_deg"].min()))
    found = line(kharaz, "plasticity")
    assert found.value == pytest.approx(fastest / v_y, rel=1e-3)
    assert (found.criterion, found.threshold, found.met, found.change) == ("V/V_y", 1.0, False, 0.0)
    assert found.says.endswith("would change nothing")
    g = [m.young / (2.0 * (1.0 + m.poisson)) for m in (glass, alumina)]
    shear = 1.0 / sum((2.0 - m.poisson) / x for m, x in zip((glass, alumina), g, strict=True))
    compliance = line(kharaz, "compliance")
    tau = kharaz.points["tau"].min()
    assert compliance.value == pytest.approx(
        2.0 * 4.0 * shear / modulus * tau / kharaz.derived["kappa"].value, rel=1e-6
    )
    assert compliance.met
    assert compliance.visible
    assert compliance.observable == "beta_cm"


def test_kharaz_calls_for_compliance_by_residuals_and_by_conditions(kharaz):
    fact = kharaz.facts["effects"]
    assert fact.figures["called"] == ["compliance"]
    test = fact.figures["tests"]["compliance"]
    assert test["chi"] == pytest.approx(1.530, abs=1e-3)  # of alumina on glass
    # with the compliance of the two materials the effect has its full strength: nothing was fitted to get it
    assert abs(test["strength"] - 1.0) < 2.0 * test["sd"]
    text = kharaz.summary()
    assert "the residuals call for tangential compliance (microslip)" in text
    assert "by its conditions the scene calls for compliance, as the residuals do" in text


def test_maw_holds_it(kharaz):
    maw = fit("kharaz-2001", method="lsq", closure="maw")
    assert line(maw, "compliance").says == "in the closure"
    assert maw.facts["effects"].ok


def test_what_is_not_given_is_named(kharaz):
    assert line(kharaz, "adhesion").says == "not given: contact.interface_energy_J_m2"
    assert line(kharaz, "adhesion").value is None
    cross = fit("cross-2019", method="lsq")
    assert line(cross, "plasticity").says == "not known: the speed"
    assert line(cross, "compliance").says == "not given: Poisson's ratios (of both materials)"
    reagle = fit("reagle-2013", method="lsq")
    assert line(reagle, "compliance").value is None
    e_n_alone = fit("netl-glass-acrylic", method="lsq")
    assert line(e_n_alone, "compliance").says == "shows in none of these rows"
    assert "effects" not in e_n_alone.facts


def test_no_criterion_rests_on_a_constant_that_is_open(impacts, tiny):
    stuck = fit(impacts(gamma=np.linspace(3.0, 15.0, 12), noise=0.05), method="lsq", scene=tiny(0.1))
    assert stuck.derived["kappa"].value is None
    assert line(stuck, "compliance").says == "not known: kappa is not determined"
    assert line(stuck, "adhesion").says == "not known: the speed"


def test_what_is_below_the_noise_cannot_be_seen(make, tiny):
    data = make("", 0, diameter=1e-5)
    found = fit(data, method="lsq", scene=tiny(0.01, 1e-6), independent=True)
    for name in ("adhesion", "rolling"):
        assert line(found, name).signal < 1.0
        assert not line(found, name).visible
    strong = fit(data, method="lsq", scene=tiny(0.2, 0.05), independent=True)
    for name in ("adhesion", "rolling"):
        assert line(strong, name).signal > 3.1
        assert line(strong, name).visible
    assert line(strong, "fluid").met
    assert line(strong, "fluid").says.endswith("at most: its law does not hold here")
    assert not line(strong, "fluid").visible
    # the scene calls for them, and these data, made without, do not
    assert strong.facts["effects"].ok
    text = " ".join(strong.summary().split())
    assert "by its conditions the scene calls for adhesion: V_s/V" in text
    assert text.count("; the residuals do not show it") == 3  # compliance, too


def test_capture_decides_whether_an_angle_exists(make, tiny):
    data = make("", 0, ("mu_app", "tan_psi_out"), diameter=1e-5, spins=False)
    found = line(fit(data, method="lsq", scene=tiny(1.0), independent=True), "adhesion")
    assert found.met
    assert found.change is None
    assert "would decide whether tan_psi_out exists" in found.says


def test_a_called_effect_that_the_scene_would_hardly_show(make, tiny):
    data = make("rolling", 1)
    found = fit(data, method="lsq", scene=tiny(0.0, 1e-6), independent=True)
    assert found.facts["effects"].figures["called"] == ["rolling"]
    assert "by its conditions the scene would hardly show rolling" in found.summary()
    assert "look for another reason" in found.summary()
    # the misfit sits near the normal, but microslip is not what the residuals look like
    assert not found.facts["lack_of_fit"].ok
    assert "Microslip" not in found.facts["lack_of_fit"].says


def test_round_trip_and_schema(kharaz, tmp_path):
    content = kharaz.to_dict()
    validator("result").validate(content)
    assert [entry["effect"] for entry in content["effects"]] == [one.effect for one in kharaz.effects]
    path = tmp_path / "result.json"
    kharaz.save(path)
    again = load_result(path)
    assert again.effects == kharaz.effects
    assert again.scene == kharaz.scene
    content["effects"][0]["met"] = "yes"
    path.write_text(json.dumps(content))
    with pytest.raises(DataError, match=r"effects\[0\]\.met' must be true or false"):
        load_result(path)


def section_of(result):
    """Blocks of the section; it needs nothing that is computed for a report."""
    return SECTIONS["effects"].build(ReportInput(result, Appraisal(pd.DataFrame(), {})))


def test_the_section_of_the_report(kharaz):
    look, tests, note, scene, criteria = section_of(kharaz)
    assert look.tone == "look"
    assert tests.rows[0][0] == "compliance"
    assert "another law of sticking" in [row[0] for row in tests.rows]
    assert note.tone == "note"
    assert "taken as alumina: sintered alpha-alumina" in scene.text
    assert ("plasticity", "no", "V/V_y = 0.29, acts above 1; would change nothing") in criteria.rows
    assert section_of(fit("netl-glass-acrylic", method="lsq")) is not None  # its conditions are told


def test_without_effects_no_section(impacts):
    result = fit(impacts(gamma=[0.0] * 5, observables=("e_n",), noise=0.01), method="lsq")
    assert section_of(result) is None


def test_compare_says_what_the_residuals_call_for():
    both = ifrfit.compare("kharaz-2001", ["ifr", "maw"], loo=False)
    text = " ".join(both.summary().split())
    assert "what the residuals call for: those of IFR for tangential compliance (microslip)" in text
    oblique = ifrfit.compare("kharaz-2001", ["ifr", "fr"], loo=False, gamma_min=15)
    assert "call for" not in oblique.summary()


def test_the_speed_of_the_scene_stands_for_rows_that_state_none(impacts, tmp_path):
    data = impacts(gamma=np.linspace(5.0, 80.0, 20), observables=("v_x", "v_n"), noise=0.02, sigma=0.02)
    scene = tmp_path / "scene.toml"
    scene.write_text("[sphere]\ndiameter_mm = 5\n[impact]\nspeed_m_s = 2")
    without, with_it = (fit(data, method="lsq", independent=True, scene=path) for path in (None, scene))
    assert "plasticity" not in without.facts["effects"].figures["tests"]
    assert "plasticity" in with_it.facts["effects"].figures["tests"]
    scene.write_text("[sphere]\ndiameter_mm = 5\n[impact]\nspeed_m_s = [2, 3]")  # which of them, nobody knows
    ranged = fit(data, method="lsq", independent=True, scene=scene)
    assert "plasticity" not in ranged.facts["effects"].figures["tests"]
