"""What `reproduce` fits: one table of every choice, and the fits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

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
    repeats_data: bool = False
    readings: tuple[str, ...] = ()


_BETA = "e_n is fixed at the printed value: beta cannot tell e_n from mu"
_FREE = "nothing is fixed: {} depends on all three constants"
_KHARAZ = (
    "prior of e_n as Chung & Ooi (2011) simulate this experiment, e_n = 0.98, since e_n is not in the data"
)
_KHARAZ_FIGURES = ("kharaz-beta", "kharaz-psi-after", "kharaz-mu-app", "kharaz-delta")

CASES = (
    Case("kharaz-2001", "kharaz-2001", _KHARAZ, _KHARAZ_FIGURES, prior={"e_n": (0.98, 0.01)}),
    Case(
        "kharaz-2001-from-15-deg",
        "kharaz-2001",
        f"{_KHARAZ}; without the near-normal impacts, where microslip is expected",
        _KHARAZ_FIGURES,
        prior={"e_n": (0.98, 0.01)},
        gamma_min=15.0,
    ),
    Case("netl-glass-acrylic", "netl-glass-acrylic", "repeats of e_n and mu, each measured by itself"),
    # mu is printed as 0.12 without and as 0.14 with spin: one fit of all three would have no single true mu
    Case("cross-2019-no-spin", "cross-2019", _BETA, ("3",), ("no spin",), ("beta",), ("e_n",)),
    Case(
        "cross-2019-spin",
        "cross-2019",
        f"{_BETA}; e_t and mu are shared by both spins; rows state the nominal spin, whose spread is in the "
        "scatter",
        ("6",),
        ("spin 0.225", "spin 0.833"),
        ("beta",),
        ("e_n",),
    ),
    Case(
        "cross-2019-psi-after",
        "cross-2019",
        "the impacts of Fig. 3 as contact angles; e_n is fixed at the printed value: psi_after cannot tell "
        "e_n from mu",
        ("8",),
        ("no spin",),
        ("psi_after_deg",),
        ("e_n",),
        repeats_data=True,
    ),
    Case(
        "cross-2019-mu-app",
        "cross-2019",
        "the impacts of Fig. 3 as apparent friction; e_n is fixed at the printed value: it enters through "
        "the slope in sticking only",
        ("9",),
        ("no spin",),
        ("mu_app",),
        ("e_n",),
        repeats_data=True,
    ),
    Case(
        "buck-2017",
        "buck-2017",
        _BETA,
        ("4a",),
        ("no spin",),
        ("beta",),
        ("e_n",),
        readings=("beta", "beta_cm"),
    ),
    Case("hashemnia-2019", "hashemnia-2019", _BETA, ("4b",), ("no spin",), ("beta",), ("e_n",)),
    Case("reagle-2013", "reagle-2013", _FREE.format("beta_tot"), ("5",), ("27 m/s",), ("beta_tot",)),
    Case("wang-2020", "wang-2020", _FREE.format("delta"), ("7",), ("no spin",), ("delta_deg",)),
)


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
