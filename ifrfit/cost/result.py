"""What was measured, with its data: the Pareto front, tables, sentences, figures, files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, cast

from ifrfit.cost.inference_costs import Reference
from ifrfit.cost.timing import KINDS, Cost, Kind, Timing, machine, table_of
from ifrfit.inference.io.plain import to_plain
from ifrfit.inference.result.display import Display
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.atomic_folder import Contents, deliver
from ifrfit.report.style import SUFFIXES, save_svg_and_png

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

FIGURES = tuple(f"cost-{kind}.{suffix}" for kind in KINDS for suffix in SUFFIXES)
COSTS = Contents("cost.csv", FIGURES, "measurement of costs", {"cost.csv": "kind,method,setting,"})
SCHEMA = "ifrfit/cost/1"

# as in result.json
_OF_FIT = (
    "ifrfit",
    "created",
    "command",
    "seed",
    "versions",
    "input",
    "closure",
    "inertia_factor",
    "noise",
    "asked",
)


@dataclass(frozen=True)
class Choice:
    """A method at a setting, with all that was measured of it.

    Attributes
    ----------
    kind, method, setting : str
    time : Timing
    errors : mapping of str to float
        By quantity.
    error_unit : str
    on_front : bool
        Whether nothing else that answers the same question is both as fast and as exact.
    """

    kind: Kind
    method: str
    setting: str
    time: Timing
    errors: Mapping[str, float]
    error_unit: str
    on_front: bool = False

    @property
    def question(self) -> tuple[str, str]:
        """What it competes in: its kind; in arithmetic each setting, which says which impacts."""
        return self.kind, self.setting if self.kind == "arithmetic" else ""

    @property
    def error(self) -> float:
        """The largest over the quantities; nan where one of them has none to state."""
        values = list(self.errors.values())
        return math.nan if any(math.isnan(value) for value in values) else max(values)


def choices_of(costs: Iterable[Cost]) -> tuple[Choice, ...]:
    """Put the quantities of each method and setting together, and mark the front of each question."""
    found: dict[tuple[str, str, str], Choice] = {}
    for cost in costs:
        key = cost.kind, cost.method, cost.setting
        if key in found:
            found[key] = replace(found[key], errors={**found[key].errors, cost.quantity: cost.error})
        else:
            errors = {cost.quantity: cost.error}
            found[key] = Choice(cost.kind, cost.method, cost.setting, cost.time, errors, cost.error_unit)
    every = list(found.values())
    return tuple(replace(one, on_front=not _beaten(one, every)) for one in every)


def _beaten(choice: Choice, others: Sequence[Choice]) -> bool:
    if math.isnan(choice.error):
        return True
    return any(
        other.question == choice.question
        and other.time.median <= choice.time.median
        and other.error <= choice.error
        and (other.time.median < choice.time.median or other.error < choice.error)
        for other in others
    )


def cheapest(choices: Iterable[Choice], error: float) -> Choice | None:
    """The fastest choice whose error is at most this; None where there is none."""
    enough = [choice for choice in choices if choice.error <= error]
    return min(enough, key=lambda choice: choice.time.median, default=None)


def best_for(choices: Sequence[Choice], targets: Sequence[float]) -> list[tuple[float, float, Choice]]:
    """The cheapest choice for each target, neighbours with the same one put together.

    Parameters
    ----------
    choices : sequence of Choice
    targets : sequence of float
        From loose to tight.

    Returns
    -------
    list of (float, float, Choice)
        The loosest and the tightest target, and the choice; targets that nothing meets are not there.
    """
    found: list[tuple[float, float, Choice]] = []
    for target in targets:
        best = cheapest(choices, target)
        if best is None:
            continue
        if found and found[-1][2] is best:
            found[-1] = (found[-1][0], target, best)
        else:
            found.append((target, target, best))
    return found


@dataclass(frozen=True, repr=False)
class Costs(Display):
    """Times and errors of methods, contact laws and precisions, measured on one machine.

    Attributes
    ----------
    costs : tuple of Cost
        One a quantity of each choice.
    fit : FitResult
        The least squares of the data behind them; by effective variance where true angles are integrated
        out.
    reference : Reference or None
        Of the errors of inference; None where that was not measured.
    about : mapping of str to str
        Of each kind, what was asked: the constants and angles of physics and arithmetic.
    notes : tuple of str
    """

    costs: tuple[Cost, ...]
    fit: FitResult = field(repr=False)
    reference: Reference | None = None
    about: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    drawn_by: ClassVar[str] = "ifrfit.cost.report"

    def _headline(self) -> str:
        return f"of {', '.join(self.kinds)}: {len(self.choices)} choices measured"

    @cached_property
    def choices(self) -> tuple[Choice, ...]:
        """A method at a setting each, with the front marked."""
        return choices_of(self.costs)

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """What was measured: inference, physics, arithmetic."""
        return tuple(dict.fromkeys(cost.kind for cost in self.costs))

    def of(self, kind: Kind) -> tuple[Choice, ...]:
        """Choices of one kind."""
        return tuple(choice for choice in self.choices if choice.kind == kind)

    def table(self) -> pd.DataFrame:
        """Exactly cost.csv: a row a quantity of each choice.

        Returns
        -------
        DataFrame
            kind, method, setting, time_s (median), error, error_unit, repeats, quantity, time_low_s,
            time_high_s (least and most), on_front (of the choice: by the largest error of its quantities).
        """
        fronts = {(c.kind, c.method, c.setting): c.on_front for c in self.choices}
        table = table_of(self.costs)
        keys = zip(table["kind"], table["method"], table["setting"], strict=True)
        return table.assign(on_front=[fronts[key] for key in keys])

    def sentences(self, kind: Kind) -> tuple[str, ...]:
        """Which choice is best for which accuracy."""
        said: tuple[str, ...] = self._renderer().sentences(self, kind)
        return said

    def to_dict(self) -> dict[str, Any]:
        """Exactly what `ifrfit cost --json` prints: the rows of cost.csv and what is said about them.

        Returns
        -------
        dict
            Only str, int, float, bool, None, list and dict, in the order of cost.schema.json. An error that
            there is none to state of is None.
        """
        fit = self.fit.to_dict()
        own = {
            "machine": machine(),
            "kinds": {kind: self._about(kind) for kind in self.kinds},
            "costs": self.table().to_dict("records"),
            "notes": self.notes,
            "warnings": self.fit.warnings,
        }
        content: dict[str, Any] = {"schema": SCHEMA} | {key: fit[key] for key in _OF_FIT} | to_plain(own)
        return content

    def _about(self, kind: Kind) -> dict[str, Any]:
        found: dict[str, Any] = {"at": self.about.get(kind), "says": self.sentences(kind)}
        return found | ({"reference": self.reference} if kind == "inference" and self.reference else {})

    def plot(self, kind: Kind = "inference") -> Figure:
        """Work-precision diagram of one kind: error against time, both logarithmic."""
        figure: Figure = self._renderer().plot(self, kind)
        return figure

    def save(self, folder: str | Path, *, force: bool = False) -> list[str]:
        """Write cost.csv and a diagram a kind; the folder appears whole or not at all.

        Returns
        -------
        list of str
            Names of the files written.

        Raises
        ------
        UsageError
            If it holds an earlier measurement and `force` is not given, or nothing can be written there.
        """

        def fill(fresh: Path) -> list[str]:
            self.table().to_csv(fresh / COSTS.record, index=False, lineterminator="\n", float_format="%.6g")
            names = [COSTS.record]
            for kind in self.kinds:
                names += save_svg_and_png(self.plot(kind), fresh, f"cost-{kind}")
            return names

        return deliver(fill, Path(folder), COSTS, force=force)

    def _renderer(self) -> ModuleType:
        return cast("ModuleType", super()._renderer())
