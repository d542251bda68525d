"""Target csv: one row of constants, or one row a draw, under a block of comments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ifrfit.exporters.exported_constants import Array, ExportedConstants
from ifrfit.exporters.json_record import AS_THEY_ARE
from ifrfit.exporters.protocol import HASH, Comments, Conditions, Translation


@dataclass(frozen=True)
class CsvTable:
    """The constants as CSV: row ``value`` first, then draws by number."""

    name: str = "csv"
    title: str = "CSV"
    comments: Comments = HASH
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """Constants as they are."""
        return AS_THEY_ARE

    def compose(
        self, constants: ExportedConstants, block: Sequence[str], draws: Mapping[str, Array] | None
    ) -> str:
        """The whole table."""
        lines = [f"# {line}".rstrip() for line in block]
        lines.append(",".join(["row", *constants.values]))
        lines.append(",".join(["value", *(repr(x) for x in constants.values.values())]))
        if draws is not None:
            rows = np.column_stack(list(draws.values()))
            lines += [",".join([str(i), *(repr(float(x)) for x in row)]) for i, row in enumerate(rows, 1)]
        return "\n".join(lines) + "\n"


EXPORTER = CsvTable()
