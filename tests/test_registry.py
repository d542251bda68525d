"""Registries: refusals in a sentence, order, entries for a while, entry points of installed packages."""

import subprocess
import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path

import pytest

import ifrfit
from ifrfit import registry
from ifrfit.errors import UsageError
from ifrfit.physics.closures import CLOSURES
from ifrfit.registry import Registry, register, registered


@pytest.fixture(autouse=True)
def _no_registry_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_REGISTRIES", list(registry._REGISTRIES))


@dataclass(frozen=True)
class Fruit:
    name: str
    sweetness: int = 0


def test_entries_keep_their_order() -> None:
    fruits = Registry("fruit", Fruit, (Fruit("pear"), Fruit("apple")))
    fruits.add(Fruit("fig"))
    assert list(fruits) == ["pear", "apple", "fig"]
    assert fruits["apple"] == Fruit("apple")
    assert len(fruits) == 3
    assert "plum" not in fruits
    assert fruits.get("plum") is None


def test_entries_can_have_an_order_of_their_own() -> None:
    fruits = Registry(
        "fruit", Fruit, (Fruit("pear", 2), Fruit("fig", 3)), order=lambda fruit: fruit.sweetness
    )
    fruits.add(Fruit("lemon", 0))
    assert list(fruits) == ["lemon", "pear", "fig"]


def test_an_unknown_name_is_answered_with_those_there_are() -> None:
    fruits = Registry("fruit", Fruit, (Fruit("pear"), Fruit("apple")))
    with pytest.raises(UsageError) as caught:
        fruits["aple"]
    assert str(caught.value) == "There is no fruit 'aple'. Choose one of pear, apple. Did you mean apple?"
    with pytest.raises(UsageError, match=r"^There is no fruit 'xyz'\. Choose one of pear, apple\. One of"):
        fruits.remove("xyz")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("pear", "There is a fruit 'pear' already: give this one another name."),
        ("", "'' cannot be the name of a fruit: take lower case, without white space."),
        ("Pear", "'Pear' cannot be the name of a fruit: take lower case, without white space."),
        ("a pear", "'a pear' cannot be the name of a fruit: take lower case, without white space."),
    ],
)
def test_a_name_that_cannot_be_is_refused(name: str, words: str) -> None:
    fruits = Registry("fruit", Fruit, (Fruit("pear"),))
    with pytest.raises(UsageError) as caught:
        fruits.add(Fruit(name))
    assert str(caught.value) == words
    assert list(fruits) == ["pear"]


def test_a_registry_can_check_its_entries() -> None:
    def check(fruit: Fruit) -> None:
        if fruit.sweetness < 0:
            raise UsageError(f"{fruit.name} is bitter")

    fruits = Registry("fruit", Fruit, check=check)
    with pytest.raises(UsageError, match="quince is bitter"):
        fruits.add(Fruit("quince", -1))
    assert not fruits


def test_register_finds_the_registry_by_the_type() -> None:
    @dataclass(frozen=True)
    class Nut:
        name: str

    nuts = Registry("nut", Nut)
    with registered(Nut("hazel"), Nut("wal")):
        assert list(nuts) == ["hazel", "wal"]
    assert not nuts


def test_what_is_registered_again_takes_the_place_of_the_one_before() -> None:
    @dataclass(frozen=True)
    class Root:
        name: str
        length: int = 1

    roots = Registry("root", Root, (Root("beet"),))
    register(Root("carrot"))
    register(Root("turnip"))
    register(Root("carrot", 2))
    assert list(roots) == ["beet", "carrot", "turnip"]
    assert roots["carrot"].length == 2
    with pytest.raises(UsageError, match=r"^There is a root 'beet' already: give this one another name\.$"):
        register(Root("beet", 3))
    for name in ("carrot", "turnip"):
        roots.remove(name)


def test_nothing_is_left_behind_when_the_second_entry_is_refused() -> None:
    @dataclass(frozen=True)
    class Berry:
        name: str

    berries = Registry("berry", Berry)
    with pytest.raises(UsageError, match="already"), registered(Berry("goose"), Berry("goose")):
        pass
    assert not berries


def test_what_is_no_entry_is_refused() -> None:
    @dataclass(frozen=True)
    class Stone:
        name: str = "granite"

    with pytest.raises(UsageError, match=r"^Stone is nothing that can be registered: it is no .*closure"):
        ifrfit.register(Stone())


PLUGIN = """
    from dataclasses import replace
    from ifrfit.physics.closures import CLOSURES

    entry = replace(CLOSURES["fr"], name="fr-too", title="FR too")
    pair = [replace(entry, name="fr-three"), replace(entry, name="fr-four")]
    taken = CLOSURES["fr"]
"""


def installed(folder: Path, **points: str) -> None:
    """A package with entry points, as an installer would leave it in `folder`."""
    (folder / "toy_closures.py").write_text(textwrap.dedent(PLUGIN))
    info = folder / "toy_closures-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy-closures\nVersion: 1.0\n")
    lines = "".join(f"{name} = {value}\n" for name, value in points.items())
    (info / "entry_points.txt").write_text(f"[ifrfit]\n{lines}")


def run(folder: Path, code: str) -> str:
    """What the code prints in a fresh process that has `folder` on its path, errors after the output."""
    code = f"import sys; sys.path.insert(0, {str(folder)!r})\n{textwrap.dedent(code)}"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    return found.stdout + found.stderr


def test_entry_points_are_loaded_by_the_first_look_that_would_miss(tmp_path: Path) -> None:
    installed(tmp_path, one="toy_closures:entry", more="toy_closures:pair")
    said = run(
        tmp_path,
        """
        from ifrfit.physics.closures import CLOSURES, get_closure
        CLOSURES["ifr"]
        print("toy_closures" in sys.modules)
        print(get_closure("fr-too").title, *CLOSURES)
        """,
    )
    assert said == f"False\nFR too {' '.join(CLOSURES)} fr-too fr-three fr-four\n"


def test_a_broken_entry_point_is_left_out_with_a_warning(tmp_path: Path) -> None:
    installed(tmp_path, broken="toy_closures:absent", taken="toy_closures:taken", one="toy_closures:entry")
    said = run(tmp_path, "from ifrfit.physics.closures import CLOSURES; print(*CLOSURES)")
    assert said.startswith(f"{' '.join(CLOSURES)} fr-too\n")
    assert (
        "The entry point 'broken' (toy_closures:absent) of group ifrfit is left out: AttributeError" in said
    )
    assert "The entry point 'taken' (toy_closures:taken) of group ifrfit is left out: UsageError" in said


def test_nothing_is_derived_from_a_registry_at_import(tmp_path: Path) -> None:
    """What is registered later would be missing from it."""
    installed(tmp_path, one="toy_closures:entry")
    said = run(
        tmp_path,
        """
        import pkgutil, importlib, ifrfit
        import ifrfit.registry as registry
        for found in pkgutil.walk_packages(ifrfit.__path__, "ifrfit."):
            if not found.name.endswith("__main__"):
                importlib.import_module(found.name)
                if registry._loaded:
                    print(found.name)
                    registry._loaded = False
        """,
    )
    assert said == ""
