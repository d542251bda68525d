"""Dataset folders: data.csv in the common schema beside a Frictionless Data Package (version 1).

The package's own properties live in its ``ifrfit`` object: provenance, conditions, default selection, noise
policy, faces, inertia factor, assumptions and printed constants.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ifrfit.data.common_errors import common_columns_in, field_of
from ifrfit.data.observations import Descriptor
from ifrfit.data.schema import PROVENANCES, SCHEMA, TABLE_SCHEMA
from ifrfit.errors import DataError

if TYPE_CHECKING:
    import pandas as pd

DATA_FILE = "data.csv"
PACKAGE_FILE = "datapackage.json"

#: JSON types of the ``ifrfit`` object, for folders that users write themselves.
_OWN_TYPES: dict[str, tuple[type, ...]] = {
    "conditions": (dict,),
    "default_observables": (list,),
    "default_series": (list,),
    "noise": (str, type(None)),
    "faces": (list,),
    "inertia_factor": (int, float),
    "assumptions": (list,),
    "printed_constants": (dict,),
    "printed_constants_by_series": (dict,),
}


def write_folder(folder: Path, about: Mapping[str, Any], table: pd.DataFrame) -> None:
    """Write data.csv and datapackage.json into `folder`, which is made if it is not there.

    Parameters
    ----------
    folder : Path
    about : mapping
        What the package says of itself apart from its numbers, as Frictionless has it: ``name``, ``title``,
        ``description``, ``licenses``, ``sources``; and the ``ifrfit`` object.
    table : DataFrame
        Columns of the common schema, in any order; those that are missing stay empty. Errors that rows have
        in common keep their columns. Numbers round-trip.
    """
    shared = common_columns_in(table.columns)
    text = table.reindex(columns=[*SCHEMA, *shared]).to_csv(index=False, lineterminator="\n")
    data = text.encode("utf-8")
    resource = {
        "profile": "tabular-data-resource",
        "name": "data",
        "path": DATA_FILE,
        "format": "csv",
        "mediatype": "text/csv",
        "encoding": "utf-8",
        "bytes": len(data),
        "hash": f"sha256:{hashlib.sha256(data).hexdigest()}",
        "schema": TABLE_SCHEMA | {"fields": [*TABLE_SCHEMA["fields"], *map(field_of, shared)]},
    }
    described = {key: about[key] for key in ("name", "title", "description", "licenses", "sources")}
    package = {
        "profile": "tabular-data-package",
        **described,
        "resources": [resource],
        "ifrfit": about["ifrfit"],
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / DATA_FILE).write_bytes(data)
    content = json.dumps(package, indent=2, ensure_ascii=False) + "\n"
    (folder / PACKAGE_FILE).write_text(content, encoding="utf-8", newline="\n")


def read_package(folder: Path) -> dict[str, Any]:
    """Read the contents of a folder's datapackage.json.

    Raises
    ------
    DataError
        If it is missing, is not JSON or lacks what a dataset of ifrfit needs.
    """
    path = folder / PACKAGE_FILE
    try:
        package = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataError(
            f"{folder}: there is no {PACKAGE_FILE}. Give the folder of a dataset, or its CSV file."
        ) from None
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(f"{path}: cannot be read as JSON ({error}). Correct it.") from None
    own = package.get("ifrfit") if isinstance(package, dict) else None
    if not isinstance(own, dict) or own.get("provenance") not in PROVENANCES:
        raise DataError(
            f"{path}: has no object 'ifrfit' that states a provenance ({', '.join(PROVENANCES)}). Add it, "
            "or read the CSV file by itself."
        )
    wrong = [key for key, kind in _OWN_TYPES.items() if key in own and not isinstance(own[key], kind)]
    if wrong:
        raise DataError(f"{path}: 'ifrfit' has a {wrong[0]} of the wrong type. Correct it.")
    return dict(package)


def verified_data(folder: Path, package: Mapping[str, Any], remedy: str) -> tuple[Path, str]:
    """Path and SHA-256 of the folder's data file, which must be the one the package describes.

    Parameters
    ----------
    folder : Path
    package : mapping
        Contents of its datapackage.json.
    remedy : str
        Sentence that ends the message when the file was changed.

    Raises
    ------
    DataError
        If the file is missing, unnamed, outside the folder or not the one that was described.
    """
    try:
        resource = package["resources"][0]
        name, stated = str(resource["path"]), str(resource["hash"])
    except (KeyError, IndexError, TypeError):
        raise DataError(
            f"{folder / PACKAGE_FILE}: names no resource with a path and a hash 'sha256:...'. Add it."
        ) from None
    path = folder / name
    if path.name != name:
        raise DataError(
            f"{folder / PACKAGE_FILE}: the path '{name}' leaves the folder. Keep the data beside it."
        )
    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        raise DataError(f"{path}: cannot be read. {remedy}") from None
    if stated != f"sha256:{digest}":
        raise DataError(f"{path}: is not the file that {PACKAGE_FILE} describes (another SHA-256). {remedy}")
    return path, digest


def to_descriptor(package: Mapping[str, Any]) -> Descriptor:
    """Return the typed view of a datapackage.json that loading, fitting and reporting use."""
    own: Mapping[str, Any] = package["ifrfit"]
    licences = package.get("licenses", ())
    return Descriptor(
        name=str(package.get("name", "")),
        title=str(package.get("title", package.get("name", ""))),
        provenance=str(own["provenance"]),
        conditions=dict(own.get("conditions", {})),
        default_observables=tuple(own.get("default_observables", ())),
        default_series=tuple(own.get("default_series", ())),
        noise=own.get("noise"),
        faces=tuple(tuple(group) for group in own.get("faces", ())),
        inertia_factor=float(own.get("inertia_factor", 0.4)),
        assumptions=tuple(own.get("assumptions", ())),
        printed_constants={key: float(value) for key, value in own.get("printed_constants", {}).items()},
        licence="; ".join(str(entry.get("title") or entry.get("name", "")) for entry in licences),
        source="; ".join(str(entry.get("title", "")) for entry in package.get("sources", ())),
    )
