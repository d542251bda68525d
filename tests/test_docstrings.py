"""Every public name ends its docstring with an example, and the examples run as they stand."""

from __future__ import annotations

import ast
import doctest
import inspect
from functools import wraps
from operator import attrgetter
from pathlib import Path

import pytest

import ifrfit

OF_PARTS = ("p_of_fit", "problem_and_optimum")  # what reports ask of a result
METHODS = [
    f"{of.__name__}.{name}"
    for of in (ifrfit.FitResult, ifrfit.Comparison)
    for name, member in vars(of).items()
    if inspect.isfunction(member) and not name.startswith("_") and name not in OF_PARTS
]
NAMES = sorted(name for name in ifrfit.__all__ if not name.startswith("_"))
OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL


def test_names_are_those_of_the_stub():
    stub = Path(ifrfit.__file__).with_suffix(".pyi")
    imported = [n for node in ast.parse(stub.read_text("utf-8")).body for n in getattr(node, "names", ())]
    assert sorted(each.asname for each in imported if not each.asname.startswith("_")) == NAMES
    assert len(NAMES) >= 28


def examples_run(name, text):
    """How many examples a docstring has, which say what they print."""
    found = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    said: list[str] = []
    result = doctest.DocTestRunner(optionflags=OPTIONS).run(found, out=said.append)
    assert result.failed == 0, "".join(said)
    return len(found.examples)


@pytest.fixture(autouse=True)
def fitted_once(monkeypatch):
    """The same fit or comparison, which many examples begin with, is made once; both are frozen."""
    for name in ("fit", "compare"):
        monkeypatch.setattr(ifrfit, name, SHARED[name])


def shared(function):
    """A function that answers a question put in the same words again as it did before."""
    seen = {}

    @wraps(function)
    def once(*args, **kwargs):
        words = repr((args, sorted(kwargs.items())))
        if " at 0x" in words or not all(isinstance(each, str) for each in args[:1]):
            return function(*args, **kwargs)
        if words not in seen:
            seen[words] = function(*args, **kwargs)
        return seen[words]

    return once


SHARED = {name: shared(getattr(ifrfit, name)) for name in ("fit", "compare")}


@pytest.mark.parametrize("name", NAMES)
def test_the_example_runs(name):
    text = inspect.getdoc(getattr(ifrfit, name)) or ""
    assert "\nExamples\n--------\n>>> import ifrfit\n" in text, f"{name} has no example"
    assert text.rpartition("\nExamples\n")[2].count("\n---") <= 1, f"the example of {name} comes last"
    assert examples_run(name, text) >= 2


@pytest.mark.parametrize("path", METHODS)
def test_the_examples_of_methods_run(path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert examples_run(path, inspect.getdoc(attrgetter(path)(ifrfit))) >= 2
