"""Readers of the JSON that the package writes: strict, and by the schemas that it ships."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import Any

import jsonschema
import referencing


@cache
def validator(name: str) -> jsonschema.Draft202012Validator:
    """Validator of result, compare, cost or simulation; the others may refer to the parts of result."""

    def content(of: str) -> dict[str, object]:
        return json.loads(files("ifrfit").joinpath(f"{of}.schema.json").read_text(encoding="utf-8"))

    result = referencing.Resource.from_contents(content("result"))
    registry = referencing.Registry().with_resources([("urn:ifrfit:result:1", result)])
    own = content(name)
    jsonschema.Draft202012Validator.check_schema(own)
    return jsonschema.Draft202012Validator(own, registry=registry)


def strict_json(text: str) -> dict[str, Any]:
    """The content of a text that holds nothing but JSON."""

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    return dict(json.loads(text, parse_constant=refuse))
