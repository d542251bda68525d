"""The catalogue of datasets: bundled with ifrfit, or the user's own in their place; load, install, remove."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ifrfit.data.descriptor import PACKAGE_FILE, read_package, to_descriptor, verified_data, write_folder
from ifrfit.data.observations import Observations
from ifrfit.data.readers import read
from ifrfit.data.schema import PROVENANCES, STAND_IN
from ifrfit.data.table_folders import path_of
from ifrfit.errors import DataError, UsageError
from ifrfit.text import meant

if TYPE_CHECKING:
    import pandas as pd

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


def listing() -> tuple[Entry, ...]:
    """Every dataset, without reading its numbers."""
    return tuple(map(entry, dataset_names()))


def load_dataset(name: str) -> Observations:
    """Load a bundled dataset, or the data that the user installed in its place.

    Parameters
    ----------
    name : str
        One of `dataset_names`.

    Returns
    -------
    Observations
        Its one source carries the `Descriptor`; its notes say what must not be overlooked.

    Raises
    ------
    UsageError
        If there is no such dataset.
    DataError
        If its data file is not the one its datapackage.json describes.

    Examples
    --------
    >>> import ifrfit
    >>> ifrfit.load_dataset("cornell-glass")
    Observations(cornell-glass: 48 rows of e_n, beta_cm; measured)
    """
    found = entry(name)
    if found.installed is None:
        return _load(found.bundled, "Install ifrfit again, or read your own table as a file.")
    remedy = f"Run 'ifrfit datasets remove {name}' and install your file again."
    return _load(found.installed, remedy).with_note(_replaced(found))


def resolve(
    name_or_path: str | Path,
    *,
    convention: Sequence[str] | Mapping[str, str] = (),
    inertia_factor: float | None = None,
) -> Observations:
    """Load a dataset by its name, a file, or a folder with a datapackage.json.

    Parameters
    ----------
    name_or_path : str or Path
        A dataset's name comes first; write ``./NAME`` for a file of that name.
    convention : sequence of str or mapping
        As in `ifrfit.read`; for files only.
    inertia_factor : float, optional
        J of the body that `ifrfit.read` takes; 2/5 if not given. Datasets state their own.

    Raises
    ------
    UsageError
        If conventions are given for a dataset, whose columns are settled.
    DataError
        If there is neither such a dataset nor such a file, or it is refused.
    """
    name, path = str(name_or_path), path_of(name_or_path)
    names = dataset_names()
    if name not in names and path.is_dir() and not (path / PACKAGE_FILE).exists():
        raise DataError(
            f"{path}: a folder of tables is not held in memory; ifrfit fit and ifrfit campaign take it. Give "
            "one of its files here, or the folder of a dataset, which has a datapackage.json."
        )
    if name in names or path.is_dir():
        if convention:
            raise UsageError(f"{name} is a dataset in the common schema: leave --convention away.")
        return load_dataset(name) if name in names else load_folder(path)
    if path.exists():
        return read(
            path, convention=convention, inertia_factor=0.4 if inertia_factor is None else inertia_factor
        )
    nearby = sorted(p.name for p in path.parent.iterdir() if p.is_file()) if path.parent.is_dir() else []
    raise DataError(
        f"{name}: there is neither a file nor a dataset of that name.{meant(path.name, (*names, *nearby))} "
        f"The datasets are {', '.join(names)}."
    )


def load_folder(folder: Path) -> Observations:
    """Load a user's own dataset folder (data.csv and datapackage.json).

    Raises
    ------
    DataError
        If the folder is no dataset, or its data file is not the one that is described.
    """
    return _load(folder, "Write its new SHA-256 there, or read the CSV file by itself.")


def printed_by_series(own: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Constants that a source prints, by series; the rest of an entry says where.

    Parameters
    ----------
    own : mapping
        The ``ifrfit`` object of datapackage.json.
    """
    return {
        label: {name: float(value) for name, value in constants.items() if isinstance(value, int | float)}
        for label, constants in own.get("printed_constants_by_series", {}).items()
    }


def printed_constants(name: str) -> dict[str, dict[str, float]]:
    """Constants that the source prints, by series.

    Returns
    -------
    dict
        ``{series: {"e_n": ..., "e_t": ..., "mu": ...}}``; empty where nothing is printed.

    Raises
    ------
    UsageError
        If there is no such dataset.
    """
    return printed_by_series(read_package(entry(name).bundled)["ifrfit"])


def _load(folder: Path, remedy: str) -> Observations:
    """Read a dataset folder and put its descriptor and its warning in."""
    package = read_package(folder)
    path, digest = verified_data(folder, package, remedy)
    descriptor = to_descriptor(package)
    data = read(path, inertia_factor=descriptor.inertia_factor)
    table = data.table
    table["source"] = descriptor.name
    source = replace(data.sources[0], name=descriptor.name, sha256=digest, descriptor=descriptor)
    momentum = tuple(replace(check, source=descriptor.name) for check in data.momentum)
    notes = tuple(note.replace(path.name, descriptor.name) for note in data.notes)
    if descriptor.provenance == "stand-in":
        materials = package["ifrfit"].get("materials", "the experiment")
        said = (
            f"{descriptor.name} is a STAND-IN, generated from the constants the paper prints: a fit to it "
            f"shows that the tool works, not what {materials} does."
        )
        notes = (said, *notes)
    return replace(data, table=table, sources=(source,), notes=notes, momentum=momentum)


def _replaced(found: Entry) -> str:
    own = found.package["ifrfit"]
    bundled = read_package(found.bundled)["ifrfit"]["provenance"]
    what = bundled if bundled == "stand-in" else f"{bundled} data"
    original = own.get("installed", {}).get("original_file", "your file")
    kind = {
        "measured": "measurement replaces",
        "published": "table replaces",
        "digitised": "digitisation replaces",
    }.get(own["provenance"], "simulation replaces")
    return (
        f"{found.name}: your {kind} the bundled {what} (from {original}); "
        f"'ifrfit datasets remove {found.name}' brings it back."
    )


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
