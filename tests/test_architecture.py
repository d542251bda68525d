"""Arrows between the modules of the package: downwards only, and never in a circle.

Every import counts: those inside functions, those for type checkers alone, and those that go by the lazy
packages, whose stubs say where a name comes from.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import ifrfit

ROOT = Path(ifrfit.__file__).parent
LAYERS = (
    ("__main__",),
    ("cli",),
    ("paper", "cost", "campaign"),
    ("report",),
    ("exporters",),
    ("simulation",),
    ("inference",),
    ("data",),
    ("physics",),
    ("registry",),
    ("errors", "text", "_version"),
    ("option_words",),
)
# the places that look a module up by its name: what draws a result, homes of registries and of entries
LATE = {"ifrfit.inference.result.display", "ifrfit.inference.workers.worker_processes", "ifrfit.registry"}
# what no fit by least squares, nor one with the exact posterior, may import
UNNEEDED = (
    *(
        f"ifrfit.{part}."
        for part in ("campaign", "cli", "cost", "exporters", "paper", "report", "simulation")
    ),
    *(f"ifrfit.inference.{part}." for part in ("appraise", "bootstrap", "comparison", "mcmc")),
    *(f"{package}." for package in ("arviz", "emcee", "jinja2", "lmfit", "matplotlib", "click")),
)


def _modules(root: Path) -> dict[str, Path]:
    """Modules and packages by name."""
    found = {}
    for path in sorted(root.rglob("*.py")):
        parts = (root.name, *path.relative_to(root).with_suffix("").parts)
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def _stub(path: Path, package: str) -> dict[str, str]:
    """Where each name of a lazy package comes from, by the stub beside it."""
    stub = path.with_suffix(".pyi")
    if path.stem != "__init__" or not stub.exists():
        return {}
    return {
        each.asname or each.name: f"{package}.{node.module}.{each.name}"
        for node in ast.walk(ast.parse(stub.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.level
        for each in node.names
    }


def _imported(tree: ast.AST) -> Iterator[str]:
    """Full names of everything that a module imports, wherever in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield from (f"{node.module}.{each.name}" for each in node.names)


def arrows(root: Path) -> dict[str, set[str]]:
    """Modules of a package that each of them imports."""
    modules = _modules(root)
    stubs = {name: _stub(path, name) for name, path in modules.items()}
    found: dict[str, set[str]] = {}
    for name, path in modules.items():
        own = found[name] = set()
        for full in _imported(ast.parse(path.read_text(encoding="utf-8"))):
            package, _, last = full.rpartition(".")
            target = stubs.get(package, {}).get(last, full)
            while target not in modules and "." in target:
                target = target.rpartition(".")[0]
            if target in modules and target != name:
                own.add(target)
    return found


def circle(graph: dict[str, set[str]]) -> list[str]:
    """A circle of modules that import one another; empty without one."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def upwards(graph: dict[str, set[str]]) -> list[str]:
    """Arrows to a higher layer, or to a neighbour in the same one."""
    rank = {name: len(LAYERS) - i for i, names in enumerate(LAYERS) for name in names}
    found = []
    for module, others in graph.items():
        own = module.split(".")[1:2]
        for other in sorted(others) if own else ():
            target = other.split(".")[1:2]
            inside = target == own
            if not inside and (not target or rank[target[0]] >= rank[own[0]]):
                found.append(f"{module} -> {other}")
    return found


@pytest.fixture(scope="module")
def graph():
    return arrows(ROOT)


def test_every_part_of_the_package_stands_in_a_layer():
    parts = {path.stem for path in ROOT.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert parts - {"__init__"} == {name for names in LAYERS for name in names}


def test_arrows_go_down(graph):
    assert upwards(graph) == []


def test_no_circle_of_modules(graph):
    assert circle(graph) == []


def test_names_become_imports_in_stated_places():
    late = {
        name
        for name, path in _modules(ROOT).items()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Name | ast.Attribute)
        and (node.id if isinstance(node, ast.Name) else node.attr) in ("import_module", "__import__")
    }
    assert late == LATE


def test_a_fit_imports_nothing_that_it_does_not_need():
    code = """
import sys, ifrfit
for method in ("lsq", "exact"):
    ifrfit.fit("cross-2019", fix={"e_n": 0.94}, method=method)
print(*sys.modules)
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = run.stdout.split()
    assert "ifrfit.inference.fit" in loaded
    assert [name for name in loaded if f"{name}.".startswith(UNNEEDED)] == []


def test_an_arrow_upwards_and_a_circle_would_be_seen(tmp_path):
    root = tmp_path / "ifrfit"
    for name, text in {
        "__init__.py": "",
        "physics/__init__.py": "",
        "physics/a.py": "def f():\n    from ifrfit.report.b import x\n",
        "report/__init__.py": "from lazy_loader import attach_stub",
        "report/__init__.pyi": "from .b import x as x",
        "report/b.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import ifrfit.report.c\n",
        "report/c.py": "from ifrfit.report import x\n",
        "cost/__init__.py": "from ifrfit.paper import y",
        "paper/__init__.py": "",
    }.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    made = arrows(root)
    assert upwards(made) == ["ifrfit.cost -> ifrfit.paper", "ifrfit.physics.a -> ifrfit.report.b"]
    assert set(circle(made)) == {"ifrfit.report.b", "ifrfit.report.c"}


def fields_typed_any(text: str) -> list[str]:
    """Annotated names in the bodies of classes that may hold anything (JSON values by name are not meant)."""
    return [
        f"{owner.name}.{ast.unparse(field.target)}"
        for owner in ast.walk(ast.parse(text))
        if isinstance(owner, ast.ClassDef)
        for field in owner.body
        if isinstance(field, ast.AnnAssign)
        and re.search(r"(^|\| )Any\b|Callable\b.*\bAny\b", ast.unparse(field.annotation))
    ]


def test_no_field_is_typed_any():
    found = {name: fields_typed_any(path.read_text("utf-8")) for name, path in _modules(ROOT).items()}
    assert {name: fields for name, fields in found.items() if fields} == {}
    control = (
        "class A:\n    one: Mapping[str, Any]\n    two: Any\n    three: Callable[..., Any] | None = None\n"
    )
    assert fields_typed_any(control) == ["A.two", "A.three"]
