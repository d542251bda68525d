"""What was measured, with its data: tables, sentences, figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, cast

from ifrfit.cost.inference_costs import Reference
from ifrfit.cost.pareto_front import Choice, choices_of
from ifrfit.cost.timing import Cost, Kind
from ifrfit.inference.result.display import Display, Renderer
from ifrfit.inference.result.fit_result import FitResult

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

COLUMNS = (
    "kind",
    "method",
    "setting",
    "time_s",
    "error",
    "error_unit",
    "repeats",
    "quantity",
    "time_low_s",
    "time_high_s",
    "on_front",
)


class CostRenderer(Renderer, Protocol):
    """What draws costs: more than a text and a figure."""

    def plot(self, shown: Any, kind: Kind = "inference", /) -> Figure:
        """Work-precision diagram of one kind."""

    def sentences(self, costs: Any, kind: Kind, /) -> tuple[str, ...]:
        """Which choice is best for which accuracy."""

    def to_dict(self, costs: Any, /) -> dict[str, Any]:
        """For strict JSON."""

    def write_costs(self, costs: Any, out: Path, *, force: bool) -> list[str]:
        """Write cost.csv and the diagrams."""


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
        import pandas as pd

        fronts = {(c.kind, c.method, c.setting): c.on_front for c in self.choices}
        rows = [
            (
                cost.kind,
                cost.method,
                cost.setting,
                cost.time.median,
                cost.error,
                cost.error_unit,
                cost.time.repeats,
                cost.quantity,
                cost.time.low,
                cost.time.high,
                fronts[cost.kind, cost.method, cost.setting],
            )
            for cost in self.costs
        ]
        return pd.DataFrame(rows, columns=list(COLUMNS))

    def sentences(self, kind: Kind) -> tuple[str, ...]:
        """Which choice is best for which accuracy."""
        return self._renderer().sentences(self, kind)

    def to_dict(self) -> dict[str, Any]:
        """Exactly what `ifrfit cost --json` prints: the rows of cost.csv and what is said about them."""
        return self._renderer().to_dict(self)

    def plot(self, kind: Kind = "inference") -> Figure:
        """Work-precision diagram of one kind: error against time, both logarithmic."""
        return self._renderer().plot(self, kind)

    def save(self, folder: str | Path, *, force: bool = False) -> list[str]:
        """Write cost.csv and the diagrams; the folder appears whole or not at all."""
        return self._renderer().write_costs(self, Path(folder), force=force)

    def _renderer(self) -> CostRenderer:
        return cast("CostRenderer", super()._renderer())
