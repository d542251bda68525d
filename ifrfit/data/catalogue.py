"""The catalogue of datasets: load, describe, validate; `install` and `remove` come from `installing`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ifrfit.data.description import description_lines, printed_by_series
from ifrfit.data.descriptor import read_package, to_descriptor, verified_data
from ifrfit.data.installation import install, remove
from ifrfit.data.locations import Entry, dataset_names, entry, meant
from ifrfit.data.observations import Observations
from ifrfit.data.readers import read
from ifrfit.errors import DataError, UsageError

__all__ = [
    "dataset_names",
    "describe",
    "install",
    "listing",
    "load_dataset",
    "load_folder",
    "printed_constants",
    "remove",
    "resolve",
]


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
    name, path = str(name_or_path), Path(name_or_path)
    names = dataset_names()
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


def describe(name: str) -> list[str]:
    """Everything `ifrfit datasets show` tells about a dataset, as lines of text.

    Raises
    ------
    UsageError, DataError
        As `load_dataset`.
    """
    return description_lines(entry(name), load_dataset(name))


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
