"""CONTRIBUTING.md shows the files that the tests register, and diffs that fit the package as it is."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
GUIDE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
INCLUDED = dict(re.findall(r"^<!-- (\S+) -->\n```python\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL))
# all that loops over a registry, without tests that register the same examples
LOOPS = (
    *("tests/physics", "tests/simulation", "tests/cli", "tests/cost", "tests/inference/comparison"),
    "tests/exporters",
    *("tests/report/page", "--ignore=tests/report/page/test_plugins.py"),
)
DIFFS = re.findall(r"^```diff\n--- a/(\S+)\n\+\+\+ b/(\S+)\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL)


def place_of(example: str) -> str:
    """The file of the package that an example would be."""
    found = re.search(rf"^`(\S+\.py)`:\n\n<!-- {example} -->$", GUIDE, re.MULTILINE)
    assert found is not None, example
    return found.group(1)


def applied(text: str, diff: str) -> str:
    """The text with what the hunks of a diff add; what stands before an addition is there once."""
    for hunk in diff.split("@@\n")[1:]:
        lines = hunk.splitlines(keepends=True)
        first = next(number for number, line in enumerate(lines) if line.startswith("+"))
        before = "".join(line.removeprefix(" ") for line in lines[:first])
        added = "".join(line[1:] for line in lines if line.startswith("+"))
        assert text.count(before) == 1, hunk
        text = text.replace(before, before + added)
    return text


def test_every_example_is_shown_as_it_is() -> None:
    examples = sorted((ROOT / "docs" / "examples" / "extensions").glob("*.py"))
    assert sorted(INCLUDED) == [str(path.relative_to(ROOT).as_posix()) for path in examples]
    for name, shown in INCLUDED.items():
        assert shown == (ROOT / name).read_text(encoding="utf-8"), name


def test_every_diff_imports_the_new_file_and_lists_its_entry() -> None:
    assert len(DIFFS) == len(INCLUDED)
    for (old, new, diff), path in zip(DIFFS, INCLUDED, strict=True):
        assert old == new
        assert sum(line.startswith("+") for line in diff.splitlines()) == 2, diff
        changed = ast.parse(applied((ROOT / old).read_text(encoding="utf-8"), diff))
        package, name = place_of(path).removesuffix(".py").replace("/", ".").rsplit(".", 1)
        imports = [node for node in ast.walk(changed) if isinstance(node, ast.ImportFrom)]
        names = {f"{node.module}.{alias.name}" for node in imports for alias in node.names}
        modules = {node.module for node in imports}
        assert f"{package}.{name}" in names | modules, diff


@pytest.mark.long
def test_inside_the_package_the_examples_need_no_other_edit(tmp_path: Path) -> None:
    """In a copy that has them all, whatever loops over a registry passes."""
    copy = tmp_path / "copy"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".*", "__pycache__"))
    for (changed, _, diff), example in zip(DIFFS, INCLUDED, strict=True):
        (copy / place_of(example)).write_text(INCLUDED[example], encoding="utf-8")
        text = (copy / changed).read_text(encoding="utf-8")
        (copy / changed).write_text(applied(text, diff), encoding="utf-8")
    found = subprocess.run(
        [sys.executable, "-m", "pytest", *LOOPS],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stdout


def test_every_example_is_registered_by_the_tests_of_plugins() -> None:
    used = (ROOT / "tests" / "plugins" / "conftest.py").read_text(encoding="utf-8")
    assert [name for name in INCLUDED if f"from extensions.{Path(name).stem} import" not in used] == []


@pytest.mark.parametrize("number", [0, 1])
def test_the_tests_that_are_shown_pass(number: int) -> None:
    shown = re.findall(r"```python\n(import numpy as np\n.*?)```", GUIDE, re.DOTALL)
    assert len(shown) == 2
    exec(shown[number], {})  # raises where an assertion fails


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "docs/decisions/README.md", "CHANGELOG.md"])
def test_links_lead_to_files(page: str) -> None:
    path = ROOT / page
    links = re.findall(r"\]\(([^)#]+)\)", path.read_text(encoding="utf-8").replace("\n", " "))
    named = [link.replace("\n", " ") for link in links if not link.startswith("http")]
    assert [link for link in named if not (path.parent / link).exists()] == []


def test_targets_and_folders_that_are_named_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = re.findall(r"(?:^    |`)make ([\w-]+)", GUIDE, re.MULTILINE)
    assert {"test", "check-fast", "lint"} <= set(targets)
    assert [name for name in targets if not re.search(rf"^{name}:", makefile, re.MULTILINE)] == []
    new = re.findall(
        r"^`(\S+)`:$", GUIDE, re.MULTILINE
    )  # files of the examples, were they put into the package
    named = re.findall(r"\b((?:tests|ifrfit|docs)/[a-z][\w./-]*)", GUIDE)
    assert [name for name in named if name not in new and not (ROOT / name.rstrip(".")).exists()] == []
