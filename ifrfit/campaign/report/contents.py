"""What a campaign leaves in its folder, and beside it."""

from __future__ import annotations

from pathlib import Path

from ifrfit.report.atomic_folder import Contents

RESULTS, PAGE = "results.parquet", "index.html"
CAMPAIGN = Contents("campaign.json", (RESULTS, PAGE), "campaign")


def unfinished(out: Path) -> Path:
    """The file beside the folder that keeps what an unfinished campaign has found."""
    place = out.resolve()
    return place.with_name(f"{place.name}.unfinished.jsonl")
