"""Where datasets are: bundled with ifrfit, or installed by the user in their place."""

from __future__ import annotations

import difflib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from ifrfit.data.descriptor import PACKAGE_FILE, read_package
from ifrfit.errors import DataError, UsageError

ENVIRONMENT = "IFRFIT_DATA_DIR"


@dataclass(frozen=True)
class Entry:
    """Where a dataset of the catalogue is.

    Attributes
    ----------
    name : str
    bundled : Path
        Folder of the dataset that comes with ifrfit.
    installed : Path or None
        Folder of the user's own data that take its place.
    """

    name: str
    bundled: Path
    installed: Path | None

    @property
    def folder(self) -> Path:
        """The folder that counts."""
        return self.installed or self.bundled

    @property
    def package(self) -> dict[str, Any]:
        """Contents of its datapackage.json."""
        return read_package(self.folder)


def bundled_root() -> Path:
    """Folder of the bundled datasets: in the installed package, else beside it in a source checkout.

    Raises
    ------
    DataError
        If neither is there.
    """
    package = Path(str(files("ifrfit")))
    for folder in (package / "_datasets", package.parent / "datasets"):
        if folder.is_dir():
            return folder
    raise DataError(f"The bundled datasets are missing from {package}. Install ifrfit again.")


def user_root() -> Path:
    """Folder of the datasets the user installed; ``IFRFIT_DATA_DIR`` overrides the usual place."""
    chosen = os.environ.get(ENVIRONMENT)
    if chosen:
        return Path(chosen) / "datasets"
    from platformdirs import user_data_dir

    return Path(user_data_dir("ifrfit", appauthor=False)) / "datasets"


def dataset_names() -> tuple[str, ...]:
    """Names of the datasets, sorted."""
    return tuple(sorted(path.parent.name for path in bundled_root().glob(f"*/{PACKAGE_FILE}")))


def entry(name: str) -> Entry:
    """Look a dataset up.

    Raises
    ------
    UsageError
        If there is no such dataset; the text lists those there are.
    """
    names = dataset_names()
    if name not in names:
        raise UsageError(
            f"There is no dataset '{name}'.{meant(name, names)} The datasets are {', '.join(names)}."
        )
    installed = user_root() / name
    return Entry(name, bundled_root() / name, installed if (installed / PACKAGE_FILE).is_file() else None)


def meant(name: str, candidates: Sequence[str]) -> str:
    """Sentence that offers the candidates close to a name; empty if there are none."""
    close = difflib.get_close_matches(name, candidates, n=3, cutoff=0.6)
    return f" Did you mean {' or '.join(close)}?" if close else ""
