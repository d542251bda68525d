"""Target json: constants, what is said of them, and draws, as one object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ifrfit.exporters.exported_constants import Array, ExportedConstants
from ifrfit.exporters.protocol import NONE, Comments, Conditions, Translation
from ifrfit.inference.io.json_text import dumps

AS_THEY_ARE = Translation(
    lines=(),
    law="none: constants by their names in ifrfit; docs/methods.md has the closures.",
    mapping=("each constant is itself.",),
    holds="as the fit does.",
)


@dataclass(frozen=True)
class JsonRecord:
    """The constants as JSON."""

    name: str = "json"
    title: str = "JSON"
    comments: Comments = NONE
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """Constants as they are."""
        return AS_THEY_ARE

    def compose(
        self, constants: ExportedConstants, block: Sequence[str], draws: Mapping[str, Array] | None
    ) -> str:
        """The whole object; ``about`` holds the block by lines."""
        content: dict[str, Any] = {
            "about": list(block),
            "closure": constants.closure.name,
            "inertia_factor": constants.inertia_factor,
            "constants": dict(constants.values),
        }
        if draws is not None:
            content["draws"] = {name: [float(x) for x in column] for name, column in draws.items()}
        return dumps(content)


EXPORTER = JsonRecord()
