"""Everything that is needed to repeat the fit, the data included."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from ifrfit.data.common_errors import common_columns_in
from ifrfit.data.schema import SCHEMA
from ifrfit.inference.io.json_text import dumps
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closures import CLOSURES
from ifrfit.report.page.blocks import Block, Code, Download, Pairs, Paragraph, Table
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.provenance import amount_words, kinds_of, left_out, provenance_words, stand_in_words
from ifrfit.report.regimes import REGIMES, regime_name

if TYPE_CHECKING:
    import pandas as pd

POINTS = "points.csv"
MOST_SHOWN = 1000  # rows of the table
MOST_INSIDE = 1_000_000  # characters of a file inside the page
NUMBERS = ("gamma_deg", "spin_x", "spin_y", "speed_m_s", "value", "sigma")
FIT_COLUMNS = ("fitted", "standardised")
FOLDED = 40


def build(given: ReportInput) -> Sequence[Block]:
    """Command, seed, versions, inputs; the data as a table and as files inside the page."""
    result = given.result
    blocks: list[Block] = [Pairs(tuple(_facts(result)))]
    if result.command:
        blocks.append(Code("The command that made this fit:", result.command))
    if not len(result.points):
        blocks.append(Paragraph("The result holds no points, so this report holds none either.", "note"))
        return blocks
    text = "" if _is_too_long(result, points_csv) else points_csv(result)
    fits_inside = 0 < len(text) <= MOST_INSIDE
    if fits_inside:
        data = amount_words(result).capitalize() if result.is_sampled else "The data used"
        words = f"{stand_in_words(result)}{data}, in the common schema."
        blocks.append(Download(POINTS, "text/csv", text, words))
    whole = "" if _is_too_long(result, _json) else _json(result)
    if 0 < len(whole) <= MOST_INSIDE:
        words = "The whole result, which ifrfit report and ifrfit predict read."
        blocks.append(Download("result.json", "application/json", whole, words))
    repeat_line = from_points(result, POINTS)
    if fits_inside and repeat_line and not result.is_sampled:
        blocks.append(Code("The same fit from the data inside this report:", repeat_line))
    if not fits_inside:
        blocks.append(Paragraph(f"The data ({len(result.points)} rows) are too large for this page.", "note"))
    blocks.append(_table(result))
    return blocks


def _json(result: FitResult) -> str:
    return dumps(result.to_dict())


def _is_too_long(result: FitResult, written: Callable[[FitResult], str]) -> bool:
    """Whether a file would be too long by far, from its first rows: all of many take long to write."""
    count = len(result.points)
    if count <= MOST_SHOWN:
        return False
    first = written(replace(result, points=result.points.head(MOST_SHOWN)))
    return len(first) / MOST_SHOWN * count > 2.0 * MOST_INSIDE


def points_csv(result: FitResult) -> str:
    """The rows used as CSV in the common schema, as `ifrfit.read` takes it, without empty columns."""
    table = result.points[[*SCHEMA, *common_columns_in(result.points.columns)]]
    columns = [
        name
        for name in table.columns
        if name in ("series", "observable", "value") or _has_content(table, name)
    ]
    return str(table[columns].to_csv(index=False, lineterminator="\n"))


def _has_content(table: pd.DataFrame, name: str) -> bool:
    column = table[name]
    if name in ("spin_x", "spin_y"):
        return bool((column != 0.0).any())
    return bool((column != "").any()) if column.dtype.kind not in "fi" else bool(column.notna().any())


def _facts(result: FitResult) -> list[tuple[str, str]]:
    pairs = []
    for source in result.inputs:
        kinds = provenance_words(kinds_of(result, source))
        about = f"{source.rows_used} of {source.rows} rows used, {kinds}. {left_out(source)}".strip()
        pairs.append((source.name, about))
        pairs.append((f"SHA-256 of {source.name}", source.sha256 or "not known"))
        if source.descriptor is not None and source.descriptor.licence:
            pairs.append((f"licence of {source.name}", source.descriptor.licence))
    if result.effort is not None:
        pairs.append(("effort", result.effort.says))
    pairs.append(("seed", str(result.seed)))
    pairs.append(("versions", ", ".join(f"{name} {version}" for name, version in result.versions.items())))
    pairs.append(("fitted", result.created or "not stated"))
    return pairs


def _table(result: FitResult) -> Table:
    points = result.points
    shown = points.head(MOST_SHOWN)
    numbers = [name for name in NUMBERS if name == "value" or _has_content(points, name)]
    head = ("row", "series", "observable", *numbers, *FIT_COLUMNS, "regime")
    columns = [shown[name].to_numpy(dtype=float) for name in (*numbers, *FIT_COLUMNS)]
    angled = shown["gamma_deg"].notna().to_numpy()
    sticks = shown["sticking"].map(bool).to_numpy(dtype=bool)
    regimes = [regime_name(result, regime) for regime in REGIMES]
    rows = tuple(
        (
            str(number) if number > 0 else "",
            str(series),
            str(observable),
            *(_number(column[i]) for column in columns),
            regimes[int(not sticks[i])] if angled[i] else "",
        )
        for i, (number, series, observable) in enumerate(
            zip(shown["row"], shown["series"], shown["observable"], strict=True)
        )
    )
    left = f" The first {MOST_SHOWN} of {len(points)}." if len(points) > MOST_SHOWN else ""
    caption = (
        f"{stand_in_words(result)}The data: {amount_words(result)} used, with the fitted values and "
        f"standardised residuals.{left}"
    )
    numbers_of = frozenset(range(3, len(head) - 1))
    return Table(caption, head, rows, numbers_of, folded=len(rows) > FOLDED, is_verbatim=True)


def _number(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.6g}"


def from_points(result: FitResult, file: str) -> str:
    """The command line that fits the rows of `file`, the points of a result, as they were fitted.

    Parameters
    ----------
    result : FitResult
    file : str
        Name of the table of its points.

    Returns
    -------
    str
        Empty where the result does not say what was asked of the constants.
    """
    if not result.asked or result.closure not in CLOSURES:
        return ""
    words = ["ifrfit", "fit", file, "--closure", result.closure, "--method", result.method]
    words += ["--noise", result.noise.policy]
    figures = result.facts["converged"].figures if "converged" in result.facts else {}
    if {"scheme", "replicates"} <= figures.keys():
        words += ["--resample", figures["scheme"], "--replicates", str(figures["replicates"])]
    words += [*_exactness(result), *_errors(result.noise.error_model)]
    if result.noise.separate:
        words += ["--separate", "noise"]
    if result.inertia_factor != 0.4:
        words += ["--inertia-factor", repr(result.inertia_factor)]
    low, high = CLOSURES[result.closure].domain(result.inertia_factor)
    default = {"e_n": (0.0, 1.0), "mu": (0.0, math.inf)} | {CLOSURES[result.closure].constant: (low, high)}
    for constant in result.asked:
        bounds = constant.lower, constant.upper
        if bounds != default[constant.name]:
            words += ["--bounds", f"{constant.name}={bounds[0]!r},{bounds[1]!r}"]
        if constant.fixed is not None:
            words += ["--fix", f"{constant.name}={constant.fixed!r}"]
        if constant.shape is not None:
            words += ["--prior", f"{constant.name}={constant.shape.exactly}"]
        elif constant.prior is not None:
            words += ["--prior", f"{constant.name}={constant.prior[0]!r},{constant.prior[1]!r}"]
        if constant.separate:
            words += ["--separate", constant.name]
        for name, text in constant.ties:
            words += ["--tie", f"{name}={text}"]
    if result.seed:
        words += ["--seed", str(result.seed)]
    return shlex.join(words)


def _errors(model: ErrorModel) -> list[str]:
    """Options of the error model that are not as by default; its fields go by the names of options."""
    words: list[str] = []
    for one in fields(ErrorModel):
        value = getattr(model, one.name)
        if value != getattr(ErrorModel(), one.name):
            option = str(one.metadata.get("key", one.name)).replace("_", "-")
            ends = value if isinstance(value, tuple) else (value,)
            words += [f"--{option}", ",".join(str(end) for end in ends)]
    return words


def _exactness(result: FitResult) -> list[str]:
    """The accuracy to ask for, where one or a time was asked for."""
    if result.effort is None or result.effort.reached is None:
        return []
    tolerance = result.effort.tolerance
    return ["--accuracy", repr(result.effort.reached if tolerance is None else tolerance)]


SECTION = ReportSection("repeat", "To repeat it", build)
