"""Columns, ranges and words of the common schema; ranges of observables are in `ifrfit.physics.observables`.

Name, type, unit and meaning of each column are in table_schema.json beside this file, a Frictionless Table
Schema that goes into the datapackage.json of a dataset as it is.
"""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

TABLE_SCHEMA: dict[str, Any] = json.loads(
    files("ifrfit.data").joinpath("table_schema.json").read_text(encoding="utf-8")
)
_FIELDS: dict[str, dict[str, Any]] = {each["name"]: each for each in TABLE_SCHEMA["fields"]}
SCHEMA = tuple(_FIELDS)
# beside them a table of observations tells how many repeats a row is the mean of, and where it stands
TABLE_COLUMNS = (*SCHEMA, "n_repeats", "source", "row")
TEXT_COLUMNS = (*(name for name in SCHEMA if _FIELDS[name]["type"] == "string"), "source")
NUMBER_COLUMNS = tuple(name for name in SCHEMA if _FIELDS[name]["type"] == "number")
PROVENANCES: tuple[str, ...] = tuple(_FIELDS["provenance"]["constraints"]["enum"])
STAND_IN = "stand-in"
_PROVENANCE_SPELLINGS = {"digitized": "digitised", "simulation": "simulated", "standin": "stand-in"}

# Nothing that was measured or computed in double precision lies below 1e-60 without being 0: rounding leaves
# 1e-17, a product of three such residues 1e-51.
TINY = 1e-60
BY_NOISE = 1.0  # below its least value, what noise may make of a reading of an observable; codes lie beyond
SIGMA_RANGE = (1e-15, 1e6)
SPEED_RANGE = (1e-9, 1e5)


def provenance_name(text: str) -> str | None:
    """Return the provenance that `text` names, or None if it names none; empty stays empty (not stated)."""
    name = text.strip().lower().replace("_", "-")
    name = _PROVENANCE_SPELLINGS.get(name.replace("-", ""), name)
    return name if name in PROVENANCES or not name else None


def template_text(raw: bool = False) -> str:
    """Return a commented CSV to fill in, with the rules: template.csv or template_raw.csv beside this file.

    The examples are simulated with e_n = 0.94, e_t = -0.98, mu = 0.12 and normal noise: of the sigmas stated,
    or of 1 % of u, near 2 m/s, on all that is after. There are no double quotes in them, and no cells that
    are sentences with quotes: a spreadsheet would put '"' before the '#'.

    Parameters
    ----------
    raw : bool
        Velocities and spins before and after instead of observables.

    Returns
    -------
    str
        Rules, header and examples, in lines of at most 88 characters; the examples are commented out
        (``#10,0.45,...``), so that they cannot be fitted by mistake, and marked as simulated.
    """
    name = "template_raw.csv" if raw else "template.csv"
    return files("ifrfit.data").joinpath(name).read_text(encoding="utf-8")
