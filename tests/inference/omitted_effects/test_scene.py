"""The scene of the data: what is known of it, what is not, and what contradicts it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from refusals import refused

import ifrfit
from ifrfit.data import Descriptor
from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.omitted_effects.experimental_conditions import setting_of
from ifrfit.physics.scenes import MATERIALS, recognised

ROOT = Path(__file__).resolve().parents[3]
SPHERE = '[sphere]\ndiameter_mm = 5\nmaterial = "soda-lime-glass"\n'
WALL = '[wall]\nmaterial = "granite"\n'


@pytest.mark.parametrize(
    ("name", "material"),
    [
        ("alumina", "alumina"),
        ("aluminium oxide", "alumina"),
        ("thick soda-lime glass", "soda-lime-glass"),
        ("Soda-Lime Glass beads", "soda-lime-glass"),
        ("polished granite block", "granite"),
        ("polished SAE 304 stainless steel", "stainless-304"),
    ],
)
def test_a_name_that_says_exactly_which_material(name, material):
    assert recognised(name) is MATERIALS[material]


@pytest.mark.parametrize(
    "name",
    ["steel", "glass", "glass beads", "stainless steel", "gamma-alumina granules", "acrylic", "", "ball"],
)
def test_a_name_that_leaves_the_material_open(name):
    assert recognised(name) is None


def described(conditions, **changed):
    data = ifrfit.load_dataset("kharaz-2001")
    descriptor = Descriptor("mine", "Mine", "measured", conditions=conditions)
    (source,) = data.sources
    return replace(data, sources=(replace(source, name="mine", descriptor=descriptor, **changed),))


def test_of_a_bundled_dataset():
    found = setting_of(ifrfit.load_dataset("kharaz-2001"), 0.4)
    assert found.diameter == (pytest.approx(5e-3),)
    assert found.speed == (3.9,)
    assert found.contact.density == MATERIALS["alumina"].density
    assert found.contact.numbers["limiting_pressure"] == MATERIALS["soda-lime-glass"].limiting_pressure
    assert found.scene.unknown == ()
    assert any("taken as alumina: sintered alpha-alumina, Munro (1997)" in says for says in found.scene.known)
    assert "interface_energy" not in found.contact.numbers


def test_what_is_not_stated_stays_unknown():
    found = setting_of(ifrfit.load_dataset("cross-2019"), 0.4)
    assert found.speed == ()
    assert found.contact.modulus is None
    assert "material of the sphere: 'steel' is none of the library" in found.scene.unknown
    assert any(
        says.startswith("speed of rows that state none: 'no spin: not printed;")
        for says in found.scene.unknown
    )
    nothing = setting_of(described({"diameter_mm": "-3", "speed_m_s": {"value": 2}}), 0.4)
    assert (nothing.diameter, nothing.speed) == ((), (2.0,))
    assert "material of the wall" in nothing.scene.unknown
    assert setting_of(described({}), 0.4) is None
    assert setting_of(described({"diameter_mm": 5}, rows_used=0), 0.4) is None


def test_a_range_has_two_ends():
    assert setting_of(ifrfit.load_dataset("reagle-2013"), 0.4).diameter == pytest.approx((2e-5, 4e-5))


def test_sources_that_differ_have_no_scene():
    data, other = ifrfit.load_dataset("kharaz-2001"), ifrfit.load_dataset("cross-2019")
    both = replace(data, sources=(*data.sources, *other.sources))
    assert setting_of(both, 0.4) is None


def test_a_hollow_ball_has_no_density_of_its_material():
    assert setting_of(ifrfit.load_dataset("kharaz-2001"), 2.0 / 3.0).contact.density is None


@pytest.fixture
def scene(tmp_path):
    def write(*parts):
        path = tmp_path / "scene.toml"
        path.write_text("\n".join(parts))
        return path

    return write


def test_of_a_scene_file(scene, impacts):
    data = ifrfit.read(impacts(gamma=[10.0, 30.0, 60.0]))
    path = scene(SPHERE.replace("5", "{ low = 4, high = 6 }"), WALL, "[impact]\nspeed_m_s = [1, 2, 3]")
    found = setting_of(data, 0.4, path)
    assert found.diameter == pytest.approx((4e-3, 6e-3))
    assert found.speed == (1.0, 3.0)
    assert (found.scene.origin, found.scene.body, found.scene.wall) == (
        "scene.toml",
        "soda-lime-glass",
        "granite",
    )
    assert "diameter 4 to 6 mm (scene.toml)" in found.scene.known
    whole = setting_of(data, 0.4, ROOT / "docs" / "scenes" / "kharaz.toml")
    assert whole.contact.numbers["interface_energy"] == 0.1
    alone = setting_of(data, 0.4, scene("[sphere]\ndiameter_mm = { mean = 5, sd = 1 }"))
    assert alone.diameter == pytest.approx((5e-3,))
    assert alone.scene.unknown == ("material of the sphere", "material of the wall")


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        (
            (SPHERE.replace("5", "6"), WALL),
            r"the diameter is 6 mm, but that of mine is 5 mm\. Leave --scene out",
        ),
        (
            (SPHERE, WALL),
            r"wall\.material is granite, but that of mine is soda-lime glass\. Leave --scene out",
        ),
        (
            (SPHERE + "inertia_factor = 0.5",),
            r"sphere\.inertia_factor = 0\.5, but the fit takes 0\.4\. Correct it",
        ),
        ((WALL,), r"sphere\.diameter_mm is missing"),
        ((SPHERE, "[spere]\ndiameter_mm = 4"), r"spere is not known; the closest is sphere"),
        (("[sphere",), "is not TOML"),
    ],
)
def test_contradictions_are_refused(scene, parts, says):
    data = described({"diameter_mm": {"value": 5}, "wall": "soda-lime glass", "material": "glass"})
    with refused(DataError, match=says):
        setting_of(data, 0.4, scene(*parts))


def test_a_scene_without_an_inertia_factor_takes_that_of_the_fit(scene, impacts):
    found = setting_of(ifrfit.read(impacts(gamma=[10.0, 30.0])), 2.0 / 3.0, scene(SPHERE, WALL))
    assert found.contact.inertia_factor == pytest.approx(2.0 / 3.0)
    assert found.contact.density is None
