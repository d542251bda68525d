"""Reading result.json back: every key is checked by hand, and a wrong one is named."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.omitted_effects.read_json import effect_from, scene_from
from ifrfit.inference.io.json_node import REMEDY, Node
from ifrfit.inference.io.read_parts import (
    asked_from,
    constant_from,
    derived_from,
    effort_from,
    fact_from,
    noise_from,
    points_from,
    source_from,
    state_from,
    statistics_from,
)
from ifrfit.inference.io.write_result import NULL_MARK, SCHEMA
from ifrfit.inference.result.fit_result import FitResult

if TYPE_CHECKING:
    pass


def load_result(path: str | Path) -> FitResult:
    """Read a result.json.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    FitResult
        Equal to the one that was saved, up to points beyond 100000 rows, which are not kept.

    Raises
    ------
    DataError
        If the file is missing, not JSON, not a result, or of an unknown schema version; names file and key.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise DataError(f"{path}: there is no such file. Name the result.json of a fit.") from None
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not text"
        raise DataError(f"{path}: cannot be read ({why}). Name the result.json of a fit.") from None
    try:
        content = json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise DataError(
            f"{path}, line {error.lineno}, column {error.colno}: this is not JSON ({error.msg}). {REMEDY}"
        ) from None
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: this is not strict JSON ({error}). {REMEDY}") from None
    return from_dict(content, name=str(path))


def _refuse_constant(word: str) -> None:
    raise ValueError(f"it holds {word}")


def from_dict(content: Any, *, name: str = "result") -> FitResult:
    """Build a result from the content of a result.json.

    Parameters
    ----------
    content : dict
        As `FitResult.to_dict` gives it.
    name : str
        Of the file, for messages.

    Returns
    -------
    FitResult

    Raises
    ------
    DataError
        If something is missing or of the wrong kind; the key is named.
    """
    root = Node(content, "", name)
    root.check(dict, "the file")
    version = root.value.get("schema")
    if version != SCHEMA:
        stated = f"schema {version!r}" if version is not None else "no key 'schema'"
        raise DataError(
            f"{name}: has {stated}; this version of ifrfit reads '{SCHEMA}'. "
            "Name the result.json of a fit, or use the ifrfit that wrote the file."
        )
    correlation = root["correlation"]
    warnings = [str(item) for item in root["warnings"].each(lambda node: node.text())]
    return FitResult(
        closure=root["closure"].text(),
        inertia_factor=root["inertia_factor"].number(),
        method=root["method"].text(),
        inputs=tuple(root["input"].each(source_from)),
        noise=noise_from(root["noise"]),
        constants=root["constants"].mapped(constant_from),
        derived=root["derived"].mapped(derived_from),
        correlation=(
            tuple(correlation["names"].each(lambda node: node.text())),
            correlation["matrix"].square(len(correlation["names"].value)),
        ),
        fit=statistics_from(root["fit"]),
        facts=root["facts"].mapped(fact_from),
        warnings=tuple(says for says in warnings if not says.startswith(NULL_MARK)),
        state=state_from(root["state"]),
        points=points_from(root["points"]),
        seed=root["seed"].whole(),
        command=root["command"].text(),
        created=root["created"].text(),
        versions=root["versions"].mapped(lambda node: node.text()),
        asked=asked_from(root["asked"]) if "asked" in root else (),
        effort=effort_from(root["effort"]) if "effort" in root else None,
        scene=scene_from(root["scene"]) if "scene" in root else None,
        effects=tuple(root["effects"].each(effect_from)) if "effects" in root else (),
    )
