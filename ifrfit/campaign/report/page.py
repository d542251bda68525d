"""The index page of a campaign: the population, its forest, and a table to sort and to filter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ifrfit.campaign.group_fit import FAILURE, KAPPA, LOOK, Row, constants_of
from ifrfit.campaign.population.partial_pooling import Population
from ifrfit.campaign.report.text import between, counts, remarks, warnings
from ifrfit.campaign.run import EMPTY, Campaign, label
from ifrfit.report.axis_words import shortened, symbol
from ifrfit.report.page.blocks import Picture
from ifrfit.report.page.charts.chart import (
    Axis,
    Box,
    Chart,
    Line,
    Mark,
    Points,
    lines_panel,
)
from ifrfit.report.page.html import asset, fill
from ifrfit.report.page.sortable_table import Cell
from ifrfit.report.style import COLOURS
from ifrfit.text import decimals, fixed

MOST_DRAWN = 40  # groups of a forest
MOST_LISTED = 20_000  # rows of the page; the Parquet file has all
_LONGEST = 34
_LETTER = 1.45  # millimetres


def page(campaign: Campaign) -> str:
    """The page; it needs nothing from elsewhere, and whatever came from a file is escaped."""
    constants = constants_of(campaign.rows)
    outlying = campaign.outlying
    odd = any(outlying)  # a column is made where it says something
    head = [*campaign.by, "rows", *constants, "p", *(["not of the population in"] if odd else []), "look"]
    first = len(campaign.by)
    rows = [
        [
            *(Cell(part or EMPTY, part) for part in key),
            Cell(str(row["n"]), repr(row["n"])),
            *(_estimate(row, name) for name in constants),
            _p_value(row),
            *([Cell(names, names)] if odd else []),
            Cell(row.get(LOOK) or "", row.get(LOOK) or ""),
        ]
        for key, row, names in zip(campaign.keys, campaign.rows, outlying, strict=True)
        if not row[FAILURE]
    ]
    return fill(
        "campaign.html.j2",
        script=f"{asset('index.js')}\n{asset('filter.js')}",
        title="Campaign",
        counts=counts(campaign),
        warnings=warnings(campaign),
        membership=remarks(campaign),
        no_population=campaign.no_population,
        population=[_population_row(each) for each in campaign.populations],
        pictures=[_picture(campaign, each, number) for number, each in enumerate(campaign.populations, 1)],
        head=head,
        rows=rows[:MOST_LISTED],
        more=max(0, len(rows) - MOST_LISTED),
        numbers=frozenset(range(first, first + len(constants) + 2)),
        failures=[
            (label(key), row[FAILURE])
            for key, row in zip(campaign.keys, campaign.rows, strict=True)
            if row[FAILURE]
        ],
        refused=campaign.refused,
        command=campaign.command,
    )


def _estimate(row: Row, name: str) -> Cell:
    status = row.get(f"{name}_status")
    if status is None:
        return Cell("-", "")
    words = "" if status == "determined" else status.replace("_", " ")
    value, sd = row[name], row[f"{name}_sd"]
    if value is None:
        low, high = row[f"{name}_lo95"], row[f"{name}_hi95"]
        ends = "" if low is None or high is None else f"[{low:.3g}, {high:.3g}]"
        return Cell(ends, "", words)
    if not sd:
        return Cell(f"{value:.6g}", repr(value), words)
    digits = decimals(sd)
    return Cell(f"{fixed(value, digits)} ± {fixed(sd, digits)}", repr(value), words)


def _p_value(row: Row) -> Cell:
    p = row["p_value"]
    return Cell("-", "") if p is None else Cell(f"{p:.2g}", repr(p))


def _population_row(found: Population) -> tuple[str, ...]:
    def numbers(of: object) -> tuple[float, float, float]:
        low, middle, high = (float(getattr(of, part)) for part in ("lo95", "median", "hi95"))
        return low, high, middle

    return (
        found.name,
        between(*numbers(found.centre)),
        between(*numbers(found.new)[:2]),
        between(*numbers(found.tau)),
        f"{found.groups.size}",
        f"{found.limits}",
        f"{found.left_out}",
    )


def _picture(campaign: Campaign, found: Population, number: int) -> Picture:
    chosen = _chosen(found)
    name = found.name
    described = "; ".join(
        f"{_label(campaign, found, at)}: alone {campaign.rows[found.groups[at]][name]:.4g}, "
        f"pooled {found.members.median[at]:.4g}"
        for at in chosen
    )
    return Picture(
        f"forest-{number}", _title(found, len(chosen)), f"{described}.", draw_forest(campaign, found)
    )


def _title(found: Population, drawn: int) -> str:
    what = "kappa = mu (1 + e_n)" if found.name == KAPPA else found.name
    few = f" ({drawn} of {found.groups.size} groups, evenly over their order by value)"
    return f"{what} of each group, alone and pooled{few if drawn < found.groups.size else ''}"


def _chosen(found: Population) -> list[int]:
    """Places of the groups that are drawn, by their pooled value; evenly spread where they are many."""
    order = np.argsort(found.members.median, kind="stable")
    if order.size > MOST_DRAWN:
        order = order[np.linspace(0, order.size - 1, MOST_DRAWN).round().astype(int)]
    return [int(place) for place in order]


def _label(campaign: Campaign, found: Population, at: int) -> str:
    return label(campaign.keys[found.groups[at]])


def draw_forest(campaign: Campaign, found: Population) -> Chart:
    """Each group alone (grey, open) and pooled (coloured), over the 95 % of new groups.

    Parameters
    ----------
    campaign : Campaign
    found : Population
    """
    chosen = _chosen(found)
    name = found.name
    marks: list[Mark] = []
    band = (float(found.new.lo95), float(found.new.hi95))
    marks.append(Box(band, (-np.inf, np.inf), COLOURS[0], 0.10))
    middle = float(found.centre.median)
    ends: list[float] = [*band]
    for place, at in enumerate(chosen):
        row = campaign.rows[found.groups[at]]
        alone = np.array([row[f"{name}_lo95"], row[f"{name}_hi95"]])
        pooled = np.array([found.members.lo95[at], found.members.hi95[at]])
        ends += [*alone.tolist(), *pooled.tolist()]
        above, below = np.array([place - 0.17]), np.array([place + 0.17])
        marks += [
            Line(alone, np.repeat(above, 2), "0.55", 1.0),
            Points(np.array([row[name]]), above, "o", 3.4, "#fff", "0.45", 0.9),
            Line(pooled, np.repeat(below, 2), COLOURS[0], 1.6),
            Points(found.members.median[[at]], below, "o", 3.8, COLOURS[0], COLOURS[0], 0.8),
        ]
    marks.append(Line(np.full(2, middle), np.array([-0.6, len(chosen) - 0.4]), COLOURS[0], 0.8, "--"))
    window = _window(ends)
    labels = [shortened(_label(campaign, found, at), _LONGEST) for at in chosen]
    names = max(12.0, 3.0 + _LETTER * max(map(len, labels)))
    return lines_panel(
        labels, Axis(*window, symbol(name), mirrored=True), marks, names + 95.0, names, line=4.6
    )


def _window(ends: Sequence[float]) -> tuple[float, float]:
    finite = [x for x in ends if np.isfinite(x)]
    low, high = min(finite), max(finite)
    room = 0.05 * (high - low) or 1e-3
    return low - room, high + room
