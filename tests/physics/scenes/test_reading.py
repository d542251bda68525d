"""Scene files: what is read, in which units, and what is refused in which words."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ifrfit.errors import DataError
from ifrfit.physics.closures import CLOSURES
from ifrfit.physics.scenes import FLUIDS, MATERIALS, read_scene

from .conftest import SCENE


def test_a_plain_scene(write):
    scene = read_scene(write())
    assert scene.name == scene.title == "scene"
    assert len(scene.sha256) == 64
    assert scene.closure == "ifr"
    assert scene.effects == "auto"
    assert scene.accuracy == 1e-3
    assert scene.axes == ("gamma_deg",)
    assert not scene.random
    assert scene.observables == ("e_n", "beta", "delta_deg")
    assert scene.conditions["diameter_m"].numbers == (0.005,)
    glass = MATERIALS["soda-lime-glass"]
    assert scene.contact.density == glass.density
    assert scene.contact.modulus == pytest.approx(glass.young / (2 * (1 - glass.poisson**2)))
    assert scene.contact.stiffness_ratio == pytest.approx(2 * (1 - 0.222) / (2 - 0.222))
    assert scene.contact.numbers["limiting_pressure"] == glass.limiting_pressure
    assert any("s41598-021-04045-6" in source for source in scene.sources)


CONTACT = (
    "[contact]\ninterface_energy_J_m2 = 0.1\ndissipation_time_us = 0.001\n[fluid]\nviscosity_Pa_s = 0.001\n"
)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("diameter_mm = 5", "diameter_m = 0.005"),
        ("diameter_mm = 5", "diameter_um = 5000"),
        ("diameter_mm = 5", "diameter_cm = 0.5"),
        ("speed_m_s = 2", "speed_mm_s = 2000"),
        ("speed_m_s = 2", "speed_cm_s = 200"),
        ("gamma_deg = [10, 30, 50]", "gamma_deg = { from = 10, to = 50, count = 3 }"),
        ("interface_energy_J_m2 = 0.1", "interface_energy_mJ_m2 = 100"),
        ("dissipation_time_us = 0.001", "dissipation_time_ns = 1"),
        ("viscosity_Pa_s = 0.001", "viscosity_mPa_s = 1"),
    ],
)
def test_units_and_forms_are_equal_to_the_last_bit(write, old, new):
    one, two = (read_scene(write(*exchange, text=SCENE + CONTACT)) for exchange in ((), ((old, new),)))
    assert one.conditions == two.conditions
    assert one.contact == two.contact


def test_own_materials_in_any_unit(write):
    material = """material = "soda-lime-glass"

[wall]"""
    forms = (
        "young_GPa = 70\npoisson = 0.2\ndensity_kg_m3 = 2500\nlimiting_pressure_MPa = 4000",
        "young_MPa = 70000\npoisson = 0.2\ndensity_g_cm3 = 2.5\nlimiting_pressure_GPa = 4",
    )
    one, two = (read_scene(write((material, f"\n[sphere.material]\n{form}\n\n[wall]"))) for form in forms)
    assert one.contact == two.contact
    assert one.contact.numbers["limiting_pressure"] == 4e9
    assert one.contact.density == 2500.0
    assert one.body == "own material"


def test_dissimilar_materials_lie_between_similar_ones(write):
    both = read_scene(write(('material = "soda-lime-glass"', 'material = "alumina"'))).contact
    glass, alumina = MATERIALS["soda-lime-glass"], MATERIALS["alumina"]
    ends = sorted(2 * (1 - m.poisson) / (2 - m.poisson) for m in (glass, alumina))
    assert ends[0] < both.stiffness_ratio < ends[1]
    softness = sum((1 - m.poisson**2) / m.young for m in (glass, alumina))
    assert both.modulus == pytest.approx(1 / softness)


def test_spins_as_rates(write):
    scene = read_scene(write(("speed_m_s = 2", "speed_m_s = 2\nomega_y_rpm = 60\nomega_x_rad_s = -3")))
    assert scene.spin_unit == "rad/s"
    assert scene.conditions["spin_y"].numbers[0] == pytest.approx(2 * math.pi)
    assert scene.conditions["spin_x"].numbers == (-3.0,)
    assert scene.observables == ("e_n", "beta", "delta_deg", "lambda_deg")


def test_distributions(write):
    scene = read_scene(
        write(
            ("diameter_mm = 5", "diameter_um = { median = 30, gsd = 1.3 }"),
            ("speed_m_s = 2", "speed_m_s = { mean = 0.1, sd = 0.2 }"),
            ("mu = 0.1", "mu = { low = 0.05, high = 0.15 }"),
        )
    )
    assert scene.random
    rng = np.random.default_rng(0)
    size = scene.conditions["diameter_m"].draw(20_000, rng)
    assert np.median(size) == pytest.approx(3e-5, rel=0.02)
    assert np.std(np.log(size)) == pytest.approx(math.log(1.3), rel=0.03)
    speed = scene.conditions["speed_m_s"].draw(20_000, rng)
    assert speed.min() >= 1e-9  # cut at what is possible
    mu = scene.constants["mu"].draw(20_000, rng)
    assert 0.05 <= mu.min() < 0.051
    assert 0.149 < mu.max() <= 0.15


def test_fluids(write):
    named = read_scene(write(text=SCENE + '\n[fluid]\nname = "air"\n')).contact.fluid
    assert named == FLUIDS["air"]
    own = read_scene(write(text=SCENE + "\n[fluid]\nviscosity_mPa_s = 50\n")).contact.fluid
    assert own.viscosity == 0.05
    assert own.mean_free_path is None


def test_a_result_in_the_place_of_constants(write):
    text = SCENE.partition("[constants]")[0] + '[constants]\nresult = "fit/result.json"\nseries = "a"\n'
    path = write(text=text)
    scene = read_scene(path)
    assert scene.result == path.parent / "fit" / "result.json"
    assert scene.series == "a"
    assert scene.random


SPHERE = 'diameter_mm = 5\nmaterial = "soda-lime-glass"'
REFUSED = [
    (("diameter_mm = 5\n", ""), "sphere.diameter_mm is missing."),
    (("diameter_mm = 5", "diameter = 5"), "sphere.diameter has no unit. Call it diameter_m, diameter_cm"),
    (("diameter_mm = 5", "diameter_mm = -5"), "sphere.diameter_mm: -5 is impossible"),
    (("diameter_mm = 5", "diameter_mm = 0"), "sphere.diameter_mm: 0 is impossible"),
    (("diameter_mm = 5", 'diameter_mm = "5"'), "sphere.diameter_mm: '5' is not a number."),
    (("diameter_mm = 5", "diameter_mm = true"), "sphere.diameter_mm: True is not a number."),
    (("diameter_mm = 5", "diameter_mm = inf"), "sphere.diameter_mm: inf is too large."),
    (("diameter_mm = 5", "diametre_mm = 5"), "sphere.diameter_mm is missing."),
    (
        (SPHERE, "diameter_mm = 5\ninertia = 0.4"),
        "sphere.inertia is not known; the closest is inertia_factor.",
    ),
    ((SPHERE, 'diameter_mm = 5\nmaterial = "gold"'), "sphere.material: there is no material 'gold'. Known"),
    ((SPHERE, "diameter_mm = 5\nmaterial = 3"), "sphere.material must be a table"),
    (("gamma_deg = [10, 30, 50]", ""), "impact.gamma_deg is missing"),
    (("gamma_deg = [10, 30, 50]", "gamma_deg = 95"), "impact.gamma_deg: 95 is impossible (0 to 90"),
    (("gamma_deg = [10, 30, 50]", "gamma_deg = []"), "impact.gamma_deg is an empty list."),
    (("gamma_deg = [10, 30, 50]", "gamma_deg = { from = 5, to = 1, count = 3 }"), "a range runs upwards"),
    (("gamma_deg = [10, 30, 50]", "gamma_deg = { from = 5, to = 9, count = 2.5 }"), "a range runs upwards"),
    (("gamma_deg = [10, 30, 50]", "gamma_deg = { mean = 5 }"), "impact.gamma_deg is none of the forms known"),
    (("speed_m_s = 2", "speed_m_s = 0"), "impact.speed_m_s: 0 is impossible (1e-09 to 100000"),
    (("speed_m_s = 2", "speed_m_s = { mean = 2, sd = 0 }"), "impact.speed_m_s: sd = 0 must be positive"),
    (("speed_m_s = 2", "speed_m_s = { low = 3, high = 2 }"), "low = 3 must lie below high = 2"),
    (("speed_m_s = 2", "speed_m_s = { median = 2, gsd = 1 }"), "gsd between 1 and 100"),
    (("e_n = 0.95", "e_n = { mean = 0.9, sd = 1e12 }"), "sd = 1e+12 is far wider than what is possible"),
    (("diameter_mm = 5", "diameter_mm = nan"), "sphere.diameter_mm: nan is not a number."),
    (("diameter_mm = 5", f"diameter_mm = 1{400 * '0'}"), "00000 is too large."),
    (
        ("speed_m_s = 2", "speed_m_s = [1, 2]\nspin_y = [0, 1]"),
        "gamma_deg, speed_m_s, spin_y all run over a grid. Keep two at most",
    ),
    (
        ("speed_m_s = 2", "speed_m_s = 2\nspin_x = 1\nomega_y_rad_s = 3"),
        "spins are given as R omega/u and as omega. Keep one form.",
    ),
    (("e_n = 0.95", "e_n = 1.2"), "constants.e_n: 1.2 is impossible (0 to 1"),
    (("e_n = 0.95", "e_n = [0.9, 0.95]"), "constants.e_n: a constant has one value or a distribution"),
    (("e_t = -0.95", "beta0 = 0.4"), "closure IFR has no beta0; it takes e_n, e_t, mu."),
    (("e_t = -0.95", "e_t = -0.95\nchi = 1.4"), "constants.chi: takes the place of e_t, which is given."),
    (("mu = 0.1", ""), "constants.mu is missing: the friction."),
    (
        ("e_n = 0.95", 'closure = "x"\ne_n = 0.95'),
        "there is no closure 'x'. Known are " + ", ".join(CLOSURES),
    ),
    (("e_n = 0.95", 'result = "r.json"\ne_n = 0.95'), "constants.e_n: constants come from r.json already."),
    (("e_n = 0.95", 'series = "a"\ne_n = 0.95'), "constants.series: belongs to constants.result"),
    (("[wall]", 'effects = ["glue"]\n[wall]'), "sphere.effects is not known"),
    (("[sphere]", 'effects = ["glue"]\n[sphere]'), "effects: there is no effect 'glue'. Known are lateral-"),
    (("[sphere]", "effects = 3\n[sphere]"), "effects must be a list of names"),
    (("[sphere]", 'observables = ["mu"]\n[sphere]'), "there is no observable 'mu' of an impact"),
    (("[sphere]", "observables = []\n[sphere]"), "observables is empty."),
    (("[sphere]", "accuracy = 0\n[sphere]"), "accuracy: 0 is impossible"),
    (("[sphere]", "noise = { mu_app = 0.1 }\n[sphere]"), "noise.mu_app: is not among the observables."),
    (("[sphere]", "wind = 3\n[sphere]"), "wind is not known"),
    (("[sphere]", "contact = 3\n[sphere]"), "contact must be a table: write [contact] above its numbers."),
    (("[sphere]", "title = 3\n[sphere]"), 'title must be text, as title = "..."'),
    (("[wall]", "[fluid]\n[wall]"), "fluid.name: there is no fluid ''. Known are air, water"),
    (("[wall]", "[fluid]\nmean_free_path_nm = 66\n[wall]"), "needs the viscosity beside it"),
    (("[wall]", "[contact]\nrolling_friction = [1, 2]\n[wall]"), "rolling_friction must be one number."),
]


@pytest.mark.parametrize(("exchange", "says"), REFUSED)
def test_refused_with_place_and_remedy(write, exchange, says):
    path = write(exchange)
    with pytest.raises(DataError) as caught:
        read_scene(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert says in text
    assert text.endswith(".")
    assert "\n" not in text
    assert len(text) < 400 + len(str(path))


def test_broken_files(tmp_path):
    with pytest.raises(DataError, match="there is no such file"):
        read_scene(tmp_path / "nix.toml")
    (tmp_path / "a.toml").write_text("a = \n")
    with pytest.raises(DataError, match=r"is not TOML \(.*line 1.*\)"):
        read_scene(tmp_path / "a.toml")
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(DataError, match="is not text in UTF-8"):
        read_scene(tmp_path / "b.toml")
    (tmp_path / "c.toml").write_text("a = " + "[" * 100_000)
    with pytest.raises(DataError, match=r"nested too deeply|is not TOML"):
        read_scene(tmp_path / "c.toml")
    with pytest.raises(DataError, match="cannot be read"):
        read_scene(tmp_path)


@pytest.mark.parametrize("nu", [0.0, 0.5])
def test_poisson_ratios_at_their_ends(write, nu):
    numbers = f"young_GPa = 1\npoisson = {nu}\n"
    material = f"\n[sphere.material]\n{numbers}[wall.material]\n{numbers}"
    text = SCENE.replace('material = "soda-lime-glass"\n', "", 2).replace("[wall]\n", "")
    contact = read_scene(write(("diameter_mm = 5", f"diameter_mm = 5\n{material}"), text=text)).contact
    assert contact.stiffness_ratio == pytest.approx(2 * (1 - nu) / (2 - nu))
    assert contact.modulus == pytest.approx(1e9 / (2 * (1 - nu**2)))


def test_every_material_has_a_source():
    for material in MATERIALS.values():
        assert material.source
        assert 0.0 <= material.poisson <= 0.5
        assert 1e9 < material.young < 1e12
