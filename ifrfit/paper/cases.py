"""What `reproduce` fits: every choice, from ``cases.toml``."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any


@dataclass(frozen=True)
class Case:
    """One fit of the table, with every choice it makes beyond the defaults, and why.

    Attributes
    ----------
    name : str
        As in the column `case` of constants.csv.
    dataset : str
    reason : str
        Why these constants are fixed, have a prior or are free.
    figures : tuple of str
        Names of the figures that show it, see `ifrfit.paper.figures`.
    series, observable : tuple of str
        Rows used; the dataset's own choice where empty.
    fixed : tuple of str
        Constants held at the value the source prints.
    prior : mapping
        Constant to (mean, sd).
    gamma_min : float, optional
        Degrees.
    closure : str
    repeats_data : bool
        Its impacts are those of another case, seen through another observable: it is not counted twice.
    readings : tuple of str
        Observables that the values may be meant as, where the source leaves it open. The one that the data
        name is taken.
    """

    name: str
    dataset: str
    reason: str
    figures: tuple[str, ...] = ()
    series: tuple[str, ...] = ()
    observable: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    prior: Mapping[str, tuple[float, float]] | None = None
    gamma_min: float | None = None
    closure: str = "ifr"
    repeats_data: bool = False
    readings: tuple[str, ...] = ()


def _case(**own: Any) -> Case:
    """A case from its table in ``cases.toml``."""
    own = {name: tuple(value) if isinstance(value, list) else value for name, value in own.items()}
    return Case(**own)


_TEXT = files("ifrfit.paper").joinpath("cases.toml").read_text("utf-8")
CASES = tuple(_case(**table) for table in tomllib.loads(_TEXT)["case"])


def case_named(name: str) -> Case:
    """A case of the table."""
    return next(case for case in CASES if case.name == name)
