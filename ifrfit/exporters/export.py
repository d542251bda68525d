"""An export: a result and a target in, the target's input as text out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.exporters.comment_block import MARK, comment_block, commented, draws_lines
from ifrfit.exporters.exported_constants import Array, ExportedConstants, exported_constants
from ifrfit.exporters.protocol import Conditions, Exporter, WholeFile
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.inference.io.json_text import replaced
from ifrfit.inference.model.entry_names import entry_name
from ifrfit.inference.result.fit_result import FitResult

_MOST_DRAWS = 1_000_000


def export(
    result: FitResult,
    target: str,
    *,
    draws: int = 0,
    angle: float | None = None,
    speed: float | None = None,
    series: str | None = None,
    fix: Mapping[str, float] | None = None,
    seed: int = 0,
) -> str:
    """Write a fit's constants as a simulator takes them.

    Parameters
    ----------
    result : FitResult
    target : str
        One of `ifrfit.exporters.registry.EXPORTERS`.
    draws : int
        How many posterior draws to append as a table.
    angle : float, optional
        Incidence angle at which a target matches that cannot match everywhere, degrees.
    speed : float, optional
        Normal speed of approach at which it does, m/s.
    series : str, optional
        Whose constants, where they are separate.
    fix : mapping of str to float, optional
        Values of the user's own for constants that the data do not determine.
    seed : int
        Of the draws.

    Returns
    -------
    str
        Comment block and input.

    Raises
    ------
    UsageError
        For an unknown target, constants that are not determined, values that the target would stop at, and
        conditions that mean nothing to it.
    """
    chosen = EXPORTERS[target]
    if draws < 0 or draws > _MOST_DRAWS:
        raise UsageError(f"--draws {draws}: it must lie between 0 and {_MOST_DRAWS}.")
    conditions = _conditions(chosen, angle, speed)
    constants = exported_constants(result, series=series, fix=fix)
    translation = chosen.translate(constants, conditions)
    block = comment_block(result, constants, chosen, translation, named=fix or {}, series=series)
    table = _draws(result, constants, draws, series, seed) if draws else None
    if isinstance(chosen, WholeFile):
        return chosen.compose(constants, block, table)
    lines = [*block, *([] if table is None else draws_lines(table))]
    return "\n".join([*commented(lines, chosen), *translation.lines]) + "\n"


def _conditions(target: Exporter, angle: float | None, speed: float | None) -> Conditions:
    for name, value in (("angle", angle), ("speed", speed)):
        if value is not None and name not in target.takes:
            raise UsageError(f"--{name} {value:g} means nothing to target {target.name}: leave it out.")
    if angle is not None and not 0.0 < angle < 90.0:
        raise UsageError(f"--angle {angle:g}: it must lie between 0 and 90 degrees from the normal.")
    if speed is not None and not (speed > 0.0 and math.isfinite(speed)):
        raise UsageError(f"--speed {speed:g}: it must be positive, in m/s.")
    return Conditions(angle, speed)


def _draws(
    result: FitResult, constants: ExportedConstants, n: int, series: str | None, seed: int
) -> dict[str, Array]:
    """Draws of each constant, (n,); those that are fixed as they are."""
    table = result.draws(n, np.random.default_rng(seed))
    found = {}
    for name, value in constants.values.items():
        entry = name if name in table else entry_name(name, series or "")
        drawn = entry in table
        found[name] = np.asarray(table[entry], dtype=float) if drawn else np.full(n, value)
    return found


def write_export(text: str, path: str | Path, *, force: bool = False) -> None:
    """Write an export to a file, which appears whole or not at all.

    Raises
    ------
    UsageError
        Where a file is there already: an earlier export is replaced with `force`, any other never.
    """
    path = Path(path)
    if path.is_dir() or not path.parent.is_dir():
        raise UsageError(f"--out {path}: name a file in a folder that is there.")
    if path.exists():
        with path.open(encoding="utf-8", errors="replace") as there:
            own = MARK in there.read(400)
        if not own:
            raise UsageError(
                f"--out {path}: this file is no export of ifrfit and is not replaced. Take another name."
            )
        if not force:
            raise UsageError(f"--out {path}: an export lies there already. Add --force to replace it.")
    with replaced(path) as fresh:
        fresh.write_text(text, encoding="utf-8", newline="\n")
