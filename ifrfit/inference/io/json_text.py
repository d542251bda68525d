"""Plain values as strict JSON that can be read, and text files that appear whole or not at all."""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ifrfit.errors import UsageError
from ifrfit.inference.option_fields import check_form


def render(value: Any, depth: int = 0) -> str:
    """Plain values as text: objects over many lines, lists of numbers on one: points stay readable."""
    pad = "  " * (depth + 1)
    if isinstance(value, dict) and value:
        lines = [f"{pad}{_dump(key)}: {render(item, depth + 1)}" for key, item in value.items()]
        return "{\n" + ",\n".join(lines) + "\n" + "  " * depth + "}"
    if isinstance(value, list) and any(isinstance(item, dict) for item in value):
        return "[\n" + ",\n".join(pad + render(item, depth + 1) for item in value) + "\n" + "  " * depth + "]"
    return _dump(value)


def _dump(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def dumps(content: dict[str, Any]) -> str:
    """The text of a JSON file: strict, one line a list, ends with a line feed."""
    return render(content) + "\n"


def write_json(content: dict[str, Any], path: Path) -> None:
    """Write a JSON file, or replace it; it appears whole or not at all."""
    with replaced(path) as fresh:
        fresh.write_text(dumps(content), encoding="utf-8", newline="\n")


def save_json(content: dict[str, Any], path: str | Path) -> None:
    """Write a JSON file to where a user wants it: as `write_json`, in a folder that is made if need be.

    Raises
    ------
    UsageError
        For a path that is none or a folder, or where nothing can be written.
    """
    check_form("path", "path", path)
    path = Path(path)
    if path.is_dir():
        raise UsageError(f"{path}: a folder lies there. Name a file in it, as {path / 'result.json'}.")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_json(content, path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror}). Choose another folder.") from None


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """A place to write a file to, which then takes the place of `path` whole, or not at all."""
    fresh = path.with_name(f".{path.name}-{uuid.uuid4().hex[:12]}.new")
    try:
        yield fresh
        os.replace(fresh, path)  # noqa: PTH105
    finally:
        fresh.unlink(missing_ok=True)
