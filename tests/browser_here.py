"""The browser in which tests open pages: where it is, or why there is none."""

from __future__ import annotations

import functools
import os
import shutil
from importlib.util import find_spec

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
# CI promises one on Linux: there its absence is a failure, elsewhere its tests are left out
PROMISED = os.environ.get("IFRFIT_NEEDS_BROWSER") == "1"


@functools.cache
def executable() -> str | None:
    """Path of a Chromium."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def lacking() -> str:
    """What has to be installed; empty where pages can be opened."""
    if executable() is None:
        return "there is no Chromium (apt-get install chromium)"
    return "" if find_spec("playwright") else "there is no playwright (pip install playwright)"
