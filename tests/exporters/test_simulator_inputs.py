"""Inputs of simulators: their documented form, signs and ranges, refusals, and the residual they state."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from functools import cache

import numpy as np
import pytest
from factories import rest_long
from refusals import refused
from scipy.integrate import solve_ivp

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.exporters.comment_block import residual_words
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Conditions
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.exporters.yade_mindlin import thornton_damping
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure

SOFT = ("lammps", "liggghts", "yade", "yade-mindlin", "mercurydpm", "mfix")


def constants(closure="fr", j=0.4, **changed):
    own = {"fr": {"beta0": 0.44}, "ifr": {"e_t": -0.96}, "f": {}, "maw": {"chi": 1.4}}[closure]
    values = {"e_n": 0.9, **own, "mu": 0.1} | changed
    entry = get_closure(closure)
    return ExportedConstants(entry, j, {name: values[name] for name in entry.constants})


def translated(target, given, angle=None):
    return once(target, given.closure.name, given.inertia_factor, tuple(given.values.items()), angle)


@cache
def once(target, closure, j, values, angle):
    """What a target makes of constants, which no test changes."""
    given = ExportedConstants(get_closure(closure), j, dict(values))
    return EXPORTERS[target].translate(given, Conditions(angle=angle))


def text(target, given, angle=None):
    return "\n".join(translated(target, given, angle).lines)


def numbers(pattern, words):
    return [float(x) for x in re.search(pattern, words).groups()]


def test_lammps_has_the_documented_form():
    said = text("lammps", constants())
    form = r"hertz/material 1e\+07 0\.9 0\.3 tangential mindlin (\S+) 0\.0 0\.1 damping coeff_restitution"
    assert re.search(rf"^pair_coeff \* \* {form}$", said, re.MULTILINE)
    assert re.search(rf"^fix wall all wall/gran granular {form} zplane 0\.0 NULL$", said, re.MULTILINE)
    assert numbers(form, said)[0] > 0.0


def test_liggghts_has_the_documented_form():
    said = text("liggghts", constants())
    assert "fix rest all property/global coefficientRestitution peratomtypepair 2 0.9 0.9 0.9 0.9" in said
    assert "fix fric all property/global coefficientFriction peratomtypepair 2 0.1 0.1 0.1 0.1" in said
    nu = numbers(r"poissonsRatio peratomtype (\S+) (\S+)", said)
    assert 0.0 <= nu[0] == nu[1] <= 0.5
    assert 5e6 <= numbers(r"youngsModulus peratomtype (\S+) ", said)[0] <= 1e9
    assert "\nfix wall all wall/gran model hertz tangential history primitive type 2 zplane 0.0" in said


def test_mercurydpm_gives_a_wall_twice_the_mass():
    said = text("mercurydpm", constants())
    assert "RestitutionCoefficient(collisionTime, 0.9, 0.44, 2.0 * particleMass);" in said


def test_yade_makes_up_for_half_the_mass_at_a_wall():
    said = text("yade", constants())
    en, et = numbers(r"en=(\S+), et=(\S+), frictionAngle=atan\(0\.1\)", said)
    # with half the mass in its dashpot a contact that lasts longer loses about ln e/sqrt(2)
    assert np.log(en) == pytest.approx(np.sqrt(2.0) * np.log(0.9), rel=0.05)
    assert 0.0 < et <= 1.0


@pytest.mark.parametrize("e_n", rest_long([0.3, 0.78, 0.974, 1.0, 0.01], 4))
def test_mindlin_of_yade_has_the_damping_that_gives_e_n(e_n):
    """Its dashpot at a wall is Tsuji's, solved here by another integrator; no attraction ends the contact."""
    said = text("yade-mindlin", constants(e_n=e_n))
    form = r"MindlinPhys\(betan=(\S+), betas=(\S+)\)"
    betan, betas = numbers(form, said)
    assert betas >= 0.0
    assert 0.0 <= numbers(r"poisson=(\S+), frictionAngle=atan\(0\.1\)", said)[0] <= 0.5
    assert " en=" not in said

    def motion(_, state):
        d = max(state[0], 0.0)
        return state[1], -max(d**1.5 + 2.0 * betan * np.sqrt(1.5) * d**0.25 * state[1], 0.0)

    def leaves(_, state):
        return state[0]

    leaves.terminal, leaves.direction = True, -1
    end = solve_ivp(motion, (0.0, 1e3), [1e-12, 1.0], events=leaves, rtol=1e-9, atol=1e-12).y[:, -1]
    assert -end[1] == pytest.approx(e_n, abs=1e-4)


def test_the_fit_of_thornton_is_what_yade_makes_of_en():
    """betan that YADE 2023.02a itself showed for en, run here once."""
    shown = {0.999: 0.004681067138183463, 0.9: 0.031306565990159074, 0.05: 1.7766773674799194, 1.0: 0.0}
    for en, betan in shown.items():
        assert thornton_damping(en) == pytest.approx(betan, rel=1e-9)


def test_mfix_is_within_its_checks():
    said = text("mfix", constants())
    assert "DES_COLL_MODEL = 'HERTZIAN'" in said
    for keyword in ("DES_EN_WALL_INPUT", "DES_ET_WALL_INPUT"):
        assert 0.0 <= numbers(rf"{keyword}\(1\) = (\S+)", said)[0] <= 1.0
    assert "MEW_W = 0.1" in said


def test_dynamo_is_xml_with_the_opposite_sign():
    wall = ET.fromstring(f"<Locals>{text('dynamo', constants())}</Locals>").find("Local")
    assert float(wall.get("Elasticity")) == 0.9
    assert float(wall.get("TangentialElasticity")) == pytest.approx(-0.44)
    smooth = ET.fromstring(f"<Locals>{text('dynamo', constants(mu=0.0))}</Locals>").find("Local")
    assert float(smooth.get("TangentialElasticity")) == pytest.approx(1.0)  # no tangential interaction


def test_dynamo_at_an_angle_has_the_beta_there():
    given = constants()
    wall = ET.fromstring(f"<Locals>{text('dynamo', given, 70.0)}</Locals>").find("Local")
    beta = ifrfit.rebound(70.0, e_n=0.9, beta0=0.44, mu=0.1, closure="fr", degrees=True).beta
    assert float(wall.get("TangentialElasticity")) == pytest.approx(-float(beta))


def test_openfoam_takes_a_lost_fraction_at_an_angle():
    given = constants()
    with refused(
        UsageError, r"not Coulomb's friction, and depends on the angle: name the angle with --angle DEG"
    ):
        text("openfoam", given)
    state = ifrfit.rebound(40.0, e_n=0.9, beta0=0.44, mu=0.1, closure="fr", degrees=True)
    lost = 1.0 - float(state.v_x) / np.sin(np.radians(40.0))
    assert numbers(r"mu +(\S+);", text("openfoam", given, 40.0))[0] == pytest.approx(lost)
    at = Incidence.of([40.0], degrees=True)
    assert translated("openfoam", given, 40.0).response(at).v_x[0] == pytest.approx(float(state.v_x))


@pytest.mark.parametrize("target", SOFT)
def test_codes_of_solid_spheres_refuse_a_shell(target):
    with refused(UsageError, r"moves solid spheres, J = 2/5, and the fit has J = 0\.666667"):
        text(target, constants(j=2.0 / 3.0))


def test_what_a_code_would_stop_at_is_refused():
    with refused(
        UsageError, r"LIGGGHTS takes a normal restitution above 0\.05 .* e_n = 0\.05: the code would"
    ):
        text("liggghts", constants(e_n=0.05))
    with refused(UsageError, r"grows without end .* the fit has e_n = 0\.005: from 0\.01 on it is exported"):
        text("yade-mindlin", constants(e_n=0.005))
    with refused(UsageError, r"LAMMPS takes a normal restitution above 0 "):
        text("lammps", constants(e_n=0.0))
    with refused(
        UsageError, r"MercuryDPM takes a tangential restitution above 0 .* the fit has 0 in sticking"
    ):
        text("mercurydpm", constants("f"))


@pytest.mark.parametrize("closure", ["f", "fr", "ifr", "maw"])
@pytest.mark.parametrize("target", [*SOFT, "dynamo", "openfoam"])
def test_the_residual_is_that_of_the_law(target, closure):
    given = constants(closure)
    if (target, closure) == ("mercurydpm", "f"):
        return
    found = translated(target, given, 40.0 if target == "openfoam" else None)
    incidence = Incidence.of(np.array(found.angles), degrees=True)
    fitted, law = given.rebound(incidence), found.response(incidence)
    np.testing.assert_allclose(law.v_n, fitted.v_n, atol=1e-4)  # e_n comes back from every code
    worst = np.max(np.abs(law.v_x - fitted.v_x))
    said = residual_words(given, found)
    assert abs(numbers(r"v_x/u off by (\S+) at worst", said)[0]) == pytest.approx(worst, rel=5e-3)
    assert worst < (0.06 if target in SOFT else 0.6)


def test_sliding_of_soft_spheres_is_coulombs():
    given = constants("fr")
    at = Incidence.of([80.0, 85.0], degrees=True)
    for target in SOFT:
        law = translated(target, given).response(at)
        np.testing.assert_allclose(law.v_x, given.rebound(at).v_x, atol=5e-3, err_msg=target)


def test_a_law_that_depends_on_its_time_step_says_so():
    """MFiX's dashpot is stronger than its slider as a contact begins, where et is small."""
    said = translated("mfix", constants(e_n=0.5, beta0=0.0, mu=0.3)).holds
    change = numbers(r"The law itself depends on the time step: .* changes by up to (\S+)\.$", said)[0]
    assert 1e-3 < change < 0.05
    for target in ("lammps", "liggghts"):
        assert "time step" not in translated(target, constants(e_n=0.5, beta0=0.0, mu=0.3)).holds
