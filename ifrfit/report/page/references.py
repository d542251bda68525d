"""What to cite for a result, as BibTeX: the model of its closure, the data, and the software."""

from __future__ import annotations

import re
from functools import cache

from ifrfit.data import Source
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closures import CLOSURES
from ifrfit.report.page.html import asset
from ifrfit.report.tables import latex_text

_ENTRY = re.compile(r"^@\w+\{(?P<key>[^,]+),.*?^\}$", re.DOTALL | re.MULTILINE)
_SOFTWARE = "ifrfit: restitution and friction constants from measured impacts of spheres on walls"


def bibtex(result: FitResult) -> str:
    """Entries of everything that a result rests on, each once."""
    closure = CLOSURES.get(result.closure)
    known = entries()
    found = [known[key] for key in (closure.references if closure is not None else ()) if key in known]
    found += [_dataset(source) for source in result.inputs if source.descriptor is not None]
    return "\n\n".join([*found, _software(result)]) + "\n"


@cache
def entries() -> dict[str, str]:
    """The entries of ``references.bib`` by key."""
    return {found["key"]: found[0] for found in _ENTRY.finditer(asset("references.bib"))}


def _dataset(source: Source) -> str:
    """A dataset by its descriptor, whose sources it names."""
    about = source.descriptor
    assert about is not None
    lines = [f"  title = {{{latex_text(about.title.rstrip('.'))}}}"]
    lines += [f"  note = {{{latex_text(about.source.rstrip('.'))}}}"] if about.source else []
    return _entry("misc", f"data-{source.name}", lines)


def _software(result: FitResult) -> str:
    lines = [f"  title = {{{_SOFTWARE}}}", "  author = {{The ifrfit developers}}"]
    version = result.versions.get("ifrfit", "")
    return _entry("misc", "ifrfit", lines + ([f"  note = {{version {version}}}"] if version else []))


def _entry(kind: str, key: str, lines: list[str]) -> str:
    key = re.sub(r"[^\w.:-]", "-", key)
    return f"@{kind}{{{key},\n" + ",\n".join(lines) + "\n}"
