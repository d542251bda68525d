"""What a campaign leaves in its folder."""

from __future__ import annotations

from ifrfit.report.atomic_folder import Contents

RESULTS, PAGE = "results.parquet", "index.html"
CAMPAIGN = Contents("campaign.json", (RESULTS, PAGE), "campaign")
