"""A grid that would fill the memory is refused in words before it is begun."""

from __future__ import annotations

import importlib

import pytest
from posterior_questions import Question, measured

from ifrfit.errors import UsageError
from ifrfit.inference.posterior import explore


def test_the_size_of_a_grid_is_foreseen(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = measured(
        "beta", [10.0, 30.0, 50.0, 70.0], seed=1, sigma=0.05, closure="ifr", c=-0.9, mu=0.15, e_n=0.9
    )
    problem = Question(rows, "ifr", fix={"e_n": 0.9}).problem()
    grid = explore(problem).grid
    assert grid.joint.size() == sum(tensor.f.size for tensor in grid.tensors)
    # the module, which is hidden by its function of the same name
    module = importlib.import_module("ifrfit.inference.posterior.explore")
    monkeypatch.setattr(module, "_MOST", grid.joint.size() // 4)
    with pytest.raises(UsageError, match="does not fit into memory"):
        explore(problem)
