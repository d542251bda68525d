"""How results are shown: by a module of the layers above, looked up by its name when asked.

Results stand below the reports that draw them and below what computes the content of a report, so no module
here imports one. Each class names the package that draws it; this is the one place where such a name becomes
an import.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, cast

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_HIDDEN = ("drawn_by", "appraised_by", "compared_by", "exported_by")


class Renderer(Protocol):
    """What a package that draws a class of results must offer."""

    def summary(self, shown: Any, /) -> str:
        """The result as text for a terminal."""

    def plot(self, shown: Any, /) -> Figure:
        """Its figure."""

    def html(self, shown: Any, /) -> str:
        """An HTML fragment for notebooks; what comes from data is escaped."""


class Display:
    """Text, figure and notebook table of a result, drawn by the package that `drawn_by` names.

    What a report shows beyond the result itself is worked out by the module that `appraised_by` names, by its
    function ``appraise``; and other closures for the same data by that of `compared_by`, by
    ``compare_result``; its constants leave by that of `exported_by`, by ``export``. Empty where
    there is nothing beyond it.
    """

    drawn_by: ClassVar[str]
    appraised_by: ClassVar[str] = ""
    compared_by: ClassVar[str] = ""
    exported_by: ClassVar[str] = ""

    def summary(self) -> str:
        """The result as text for a terminal, at most 100 columns."""
        return self._renderer().summary(self)

    def plot(self) -> Figure:
        """Figure of the result; not known to pyplot."""
        return self._renderer().plot(self)

    def __dir__(self) -> list[str]:
        """What users want; not how a result is drawn."""
        own = (name for name in super().__dir__() if name not in _HIDDEN)
        return [name for name in own if not name.startswith("_") or name.startswith("__")]

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self._headline()}>"

    def _headline(self) -> str:
        """The result in a line."""
        return ""

    def _repr_html_(self) -> str:
        return self._renderer().html(self)

    def _renderer(self) -> Renderer:
        return cast("Renderer", import_module(self.drawn_by))

    def _appraisal(self) -> Any:
        return import_module(self.appraised_by).appraise(self)

    def _comparison(self) -> Any:
        return import_module(self.compared_by).compare_result(self)

    def _export(self, target: str, **choices: Any) -> str:
        return str(import_module(self.exported_by).export(self, target, **choices))
