"""Identifiers of the package speak the field's language: words that once had several meanings stay out."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import ifrfit

ROOT = Path(ifrfit.__file__).parent
# retired word: what to say in its place
RETIRED = {
    "again": "repeated, or what is done: compare_result",
    "alongside": "beside, or the quantity's name",
    "apart": "separate; a distance; independent_e_n",
    "asking": "request",
    "both": "what the two are: e_n_and_mu_free",
    "bought": "cost",
    "calling": "call, keyword",
    "held": "fixed, constrained",
    "judge": "verdict",
    "judged": "verdict",
    "knows": "known: e_n_known",
    "leans": "correlation, sensitivity",
    "led": "conditional, given",
    "reach": "half_width, u_max, threshold",
    "ringed": "outlier, marked",
    "road": "method, path",
    "settle": "converge, decide",
    "settled": "converged, determined",
    "stated": "given",
    "told": "the thing that was said: scene",
    "twice": "duplicate, double_counted",
    "wanted": "requested",
    "whereabouts": "location",
}


def words(identifier: str) -> list[str]:
    """Words of snake_case and CamelCase, in lower case."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", identifier).lower().strip("_").split("_")


def identifiers(source: str) -> Iterator[str]:
    """Names of classes, functions, arguments, fields, and of what a module defines."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name
        if isinstance(node, ast.arg):
            yield node.arg
        if isinstance(node, ast.ClassDef | ast.Module):
            for each in node.body:
                targets = each.targets if isinstance(each, ast.Assign) else [getattr(each, "target", None)]
                yield from (target.id for target in targets if isinstance(target, ast.Name))


def retired(source: str, module: str = "") -> set[str]:
    """Identifiers of a module that hold a retired word; its own name is one of them."""
    return {name for name in (module, *identifiers(source)) if RETIRED.keys() & set(words(name))}


def test_no_identifier_holds_a_retired_word() -> None:
    found = {
        f"{path.relative_to(ROOT)}: {name}": [RETIRED[word] for word in words(name) if word in RETIRED]
        for path in sorted(ROOT.rglob("*.py"))
        for name in retired(path.read_text(encoding="utf-8"), path.stem)
    }
    assert found == {}


def test_a_retired_word_would_be_seen() -> None:
    source = """
HELD = 1
class SettledFit:
    told: str
    def compare_again(self, *, wanted, apart_from=2): ...
def theldt(stand): ...
"""
    assert retired(source, "judge") == {
        "HELD", "SettledFit", "told", "compare_again", "wanted", "apart_from", "judge"
    }  # fmt: skip
