"""What `reproduce` fits: every choice, from ``cases.toml``, and the fits."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Any

from ifrfit.data import Observations
from ifrfit.data.catalogue import load_dataset, printed_constants
from ifrfit.data.locations import entry
from ifrfit.errors import IfrfitError
from ifrfit.inference.fit import fit
from ifrfit.paper.recovered_constants import FittedCase, lines_of


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


def _case(table: dict[str, Any]) -> Case:
    """A case from its table in ``cases.toml``."""
    own: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in table.items()}
    return Case(**own)


_TEXT = files("ifrfit.paper").joinpath("cases.toml").read_text("utf-8")
CASES = tuple(_case(table) for table in tomllib.loads(_TEXT)["case"])


def case_named(name: str) -> Case:
    """A case of the table."""
    return next(case for case in CASES if case.name == name)


def fit_case(case: Case, *, reading: str | None = None) -> FittedCase:
    """Fit one case by the exact posterior.

    Data that the user installed in the place of a dataset are taken; if they lack what the case asks for,
    that is told in `refusal`.

    Parameters
    ----------
    case : Case
    reading : str, optional
        Observable to take the values for, one of the case's readings; what the data name if not given.
    """
    printed = printed_constants(case.dataset)
    own = printed.get(case.series[0], {}) if case.series else {}
    try:
        data, observable = _read(case, load_dataset(case.dataset), reading)
        result = fit(
            data,
            series=case.series,
            observable=observable,
            fix={name: own[name] for name in case.fixed},
            prior=case.prior,
            gamma_min=case.gamma_min,
            closure=case.closure,
        )
    except IfrfitError as error:
        if entry(case.dataset).installed is None:
            raise
        return FittedCase(case.name, case.dataset, case.reason, None, (), str(error), case.repeats_data)
    lines = lines_of(result, own, case.name, case.dataset, case.reason, case.figures)
    return FittedCase(case.name, case.dataset, case.reason, result, lines, repeats_data=case.repeats_data)


def _read(case: Case, data: Observations, reading: str | None) -> tuple[Observations, tuple[str, ...]]:
    """The data with their values taken for one of the readings, and the observables to use."""
    table = data.table
    there = [name for name in case.readings if (table["observable"] == name).any()]
    if not there:
        return data, case.observable
    if reading in (None, there[0]):
        return data, (there[0],)
    named = table[table["observable"] == there[0]].reset_index(drop=True)
    return replace(data, table=named.assign(observable=reading)), (str(reading),)
