"""What was measured, with its data: tables, sentences, figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, cast

from ifrfit.cost.inference_costs import Reference
from ifrfit.cost.pareto_front import Choice, choices_of
from ifrfit.cost.timing import Cost, Kind, table_of
from ifrfit.inference.result.display import Display
from ifrfit.inference.result.fit_result import FitResult

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True)
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
        """Exactly what `ifrfit cost --json` prints: the rows of cost.csv and what is said about them."""
        content: dict[str, Any] = self._renderer().to_dict(self)
        return content

    def plot(self, kind: Kind = "inference") -> Figure:
        """Work-precision diagram of one kind: error against time, both logarithmic."""
        figure: Figure = self._renderer().plot(self, kind)
        return figure

    def save(self, folder: str | Path, *, force: bool = False) -> list[str]:
        """Write cost.csv and the diagrams; the folder appears whole or not at all."""
        names: list[str] = self._renderer().write_costs(self, Path(folder), force=force)
        return names

    def _renderer(self) -> ModuleType:
        return cast("ModuleType", super()._renderer())
