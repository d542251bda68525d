"""The folder of a campaign: its record, its table and its index page."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from ifrfit._version import __version__
from ifrfit.campaign.population.leave_one_out import FEWEST_OF_SEVERAL
from ifrfit.campaign.population.partial_pooling import Population
from ifrfit.campaign.report.contents import CAMPAIGN, PAGE, RESULTS
from ifrfit.campaign.report.page import page
from ifrfit.campaign.report.table import results_table
from ifrfit.campaign.run import Campaign
from ifrfit.inference.io.json_text import write_json
from ifrfit.report.atomic_folder import deliver


def write_campaign(campaign: Campaign, out: Path, *, force: bool) -> list[str]:
    """Write campaign.json, results.parquet and index.html into a folder, whole or not at all.

    Raises
    ------
    UsageError
        If the folder holds an earlier campaign and `force` is not given, or nothing can be written there.
    """
    return deliver(lambda folder: _fill(campaign, folder), out, CAMPAIGN, force=force)


def _fill(campaign: Campaign, folder: Path) -> list[str]:
    results_table(campaign).to_parquet(folder / RESULTS, index=False)
    (folder / PAGE).write_text(page(campaign), encoding="utf-8", newline="\n")
    write_json(record(campaign), folder / CAMPAIGN.record)
    return [CAMPAIGN.record, RESULTS, PAGE]


def record(campaign: Campaign) -> dict[str, Any]:
    """What was asked, and what was found of the population."""
    return {
        "schema": "ifrfit/campaign/1",
        "ifrfit": __version__,
        "command": campaign.command,
        "seed": campaign.seed,
        "by": list(campaign.by),
        "closure": campaign.model.closure,
        "method": campaign.method,
        "noise": campaign.noise,
        "facts": campaign.facts,
        "groups": len(campaign.rows),
        "fitted": campaign.fitted,
        "failed": campaign.failed,
        "refused_files": [{"file": each.name, "reason": each.reason} for each in campaign.refused],
        "unread": campaign.unread or None,
        "no_population": campaign.no_population or None,
        "mostly_open": {
            each.name: {"groups": each.determined, "limits": each.limits} for each in campaign.mostly_open
        },
        "populations": {each.name: _population(campaign, each) for each in campaign.populations},
    }


def _population(campaign: Campaign, found: Population) -> dict[str, Any]:
    def numbers(of: Any) -> dict[str, Any]:
        return {
            "value": float(of.median),
            "interval68": [float(of.lo68), float(of.hi68)],
            "interval95": [float(of.lo95), float(of.hi95)],
        }

    return {
        "groups": int(found.groups.size),
        "limits": found.limits,
        "left_out": found.left_out,
        "not_of_the_population": None
        if found.outlying is None
        else [{"group": list(campaign.keys[at]), "p_value": p} for at, p in found.outlying.items()],
        "two_populations": _two(found),
        "cut_by_ends": [
            {"constant": each.constant, "end": each.end, "groups": each.groups, "shift": each.shift}
            for each in found.cut
        ],
        "groups_left_out": None if found.missed is None else asdict(found.missed),
        "median_group": numbers(found.centre),
        "new_group": numbers(found.new),
        "sd_over_groups_in_its_coordinate": numbers(found.tau),
    }


def _two(found: Population) -> dict[str, Any] | None:
    """The two populations that describe the groups better, or none; None where it was not looked at."""
    if found.groups.size < FEWEST_OF_SEVERAL:
        return None
    if found.two is None:
        return {"p_value": None, "populations": []}
    each = zip(found.two.sizes, found.medians_of_two, strict=True)
    return {
        "p_value": found.two.p_value,
        "populations": [{"groups": groups, "median_group": middle} for groups, middle in each],
    }
