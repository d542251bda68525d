"""Put a user's own data in the place of a bundled dataset, and bring the bundled one back."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ifrfit.data.descriptor import read_package, write_folder
from ifrfit.data.locations import entry, user_root
from ifrfit.data.readers import read
from ifrfit.data.schema import PROVENANCES, STAND_IN
from ifrfit.errors import DataError, UsageError

if TYPE_CHECKING:
    import pandas as pd


def install(
    name: str,
    file: str | Path,
    *,
    provenance: str = "digitised",
    convention: Sequence[str] | Mapping[str, str] = (),
) -> Path:
    """Let the data of a file take the place of a bundled dataset from now on.

    Parameters
    ----------
    name : str
        A bundled dataset.
    file : str or Path
        Anything `ifrfit.read` takes; read, and refused if need be, before anything is written.
    provenance : str
        Of the rows that do not state theirs: ``measured``, ``published``, ``digitised`` or ``simulated``.
    convention : sequence of str or mapping
        As in `ifrfit.read`.

    Returns
    -------
    Path
        Folder with data.csv, in the common schema, and datapackage.json.

    Raises
    ------
    UsageError
        For an unknown dataset or provenance.
    DataError
        If the file is refused, is empty or contains stand-in rows.
    """
    found = entry(name)
    if provenance not in PROVENANCES or provenance == "stand-in":
        possible = ", ".join(p for p in PROVENANCES if p != "stand-in")
        raise UsageError(f"Provenance '{provenance}' cannot be installed: use one of {possible}.")
    package = read_package(found.bundled)
    inertia_factor = float(package["ifrfit"].get("inertia_factor", 0.4))
    path = Path(file)
    table = read(path, convention=convention, inertia_factor=inertia_factor).table
    forbidden = table.loc[table["provenance"] == STAND_IN, "row"]
    if len(forbidden):
        raise DataError(
            f"{path.name}, line {forbidden.iloc[0]}, column provenance: a stand-in cannot replace {name}. "
            "Install points that were measured or digitised."
        )
    table["provenance"] = table["provenance"].replace("", provenance)
    target = user_root() / name
    _write_whole(target, _about(package, path, table), table)
    return target


def remove(name: str) -> None:
    """Bring the bundled dataset back.

    Raises
    ------
    UsageError
        For an unknown dataset, or one that nothing was installed for.
    """
    found = entry(name)
    if found.installed is None:
        raise UsageError(f"Nothing of yours is installed for {name}: the bundled dataset is in use.")
    # renamed first: a half-deleted folder never counts as a dataset
    doomed = Path(tempfile.mkdtemp(dir=found.installed.parent, prefix=f".{name}-")) / name
    found.installed.replace(doomed)
    shutil.rmtree(doomed.parent)


def _about(package: Mapping[str, Any], path: Path, table: pd.DataFrame) -> dict[str, Any]:
    """Describe the user's data: conditions and constants stay, assumptions about the stand-in go."""
    own = package["ifrfit"]
    series, observables = set(table["series"]), set(table["observable"])
    mine = {
        # of rows that differ the one that claims least
        "provenance": max(table["provenance"], key=PROVENANCES.index),
        **{key: own[key] for key in ("materials", "figures", "conditions") if key in own},
        "default_observables": _kept(own.get("default_observables", ()), observables),
        "default_series": _kept(own.get("default_series", ()), series),
        "noise": None,
        "faces": [kept for group in own.get("faces", ()) if len(kept := _kept(group, series)) > 1],
        "inertia_factor": own.get("inertia_factor", 0.4),
        "assumptions": [],
        "printed_constants": own.get("printed_constants", {}),
        "printed_constants_by_series": own.get("printed_constants_by_series", {}),
        "installed": {
            "original_file": path.name,
            "original_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
            "replaces": own["provenance"],
        },
    }
    name = package["name"]
    return {
        "name": name,
        "title": str(package["title"]).removesuffix(": stand-in"),
        "description": f"The user's own data in the place of the bundled {own['provenance']} of {name}.",
        "licenses": [{"name": "notspecified", "title": "your own data; no licence stated"}],
        "sources": [{"title": f"{path.name}, installed by the user"}, *package.get("sources", ())],
        "ifrfit": mine,
    }


def _kept(requested: Iterable[str], there: set[str]) -> list[str]:
    return [name for name in requested if name in there]


def _write_whole(target: Path, about: Mapping[str, Any], table: pd.DataFrame) -> None:
    """Write beside, then rename: the folder appears whole or not at all; an older one stays until then."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}-") as scratch:
            new, old = Path(scratch) / "new", Path(scratch) / "old"
            write_folder(new, about, table)
            if target.exists():
                target.replace(old)
            try:
                new.replace(target)
            except OSError:
                if old.exists():
                    old.replace(target)
                raise
    except OSError as error:
        raise DataError(
            f"{target}: cannot be written ({error.strerror}). Let IFRFIT_DATA_DIR name a folder that can."
        ) from None
