"""Options in the words of who asks: ``--fix e_n=0.9`` in a shell is ``fix={"e_n": 0.9}`` in Python.

Messages are written once, as the command line has them. This module imports nothing heavy, because errors are
made of it.
"""

from __future__ import annotations

import re

_WORD = r"'[^']*'|[^\s;()'\"]+"  # of a shell, quoted where need be
_OPTION = re.compile(rf"--([a-z](?:[a-z0-9-]*[a-z0-9])?)(?: (?!--)({_WORD}))?")
_COMMANDS = re.compile(r"('(?:ifrfit|dask|pip) [^']*')")  # to be typed as they stand
_OBJECTS = re.compile(r"(\w+)\(([^()]*)\) \1\(([^()]*)\)")
_VALUE = r'"[^"]*"|[\w.+-]*\w'
_SAME = re.compile(rf"(\w+=)(?:({_VALUE})|\[([^\]]*)\]) \1(?:({_VALUE})|\[([^\]]*)\])")
_CALL = re.compile(r'\bifrfit (fit|compare|simulate)\b(?: (\w+=(?:"[^"]*"|[\w.]+)))?')
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
_PLACEHOLDER = re.compile(r"[A-Z_]+")  # as DIR

# words of the sentence behind an option without a value
_GRAMMAR = re.compile(
    "a|again|alone|and|anew|at|away|begins|beside|belongs|both|but|cannot|chooses|contradicts|do|does|first|fits|for"
    "|from|goes|if|in|instead|is|it|itself|keeps|may|must|names|needs?|of|on|once|or|out|picks?|shows|takes|that|the"
    "|then|there|to|together|too|under|until|was|with|without|would|writes|wrote"
)
# keyword of the shell to the object that has it, and its field; all others are keywords of functions
_FIELDS = {
    "tails": ("Noise", "tails"),
    "dof": ("Noise", "dof"),
    "common-errors": ("Noise", "common_errors"),
    "sigma-velocity": ("Noise", "sigma_velocity"),
    "sigma-spin": ("Noise", "sigma_spin"),
    "angle-errors": ("AngleErrors", "kind"),
    "angle-population": ("AngleErrors", "population"),
    "sigma-gamma": ("AngleErrors", "sigma_deg"),
    "angle-offset": ("AngleErrors", "offset_sd"),
    "max-steps": ("MCMC", "max_steps"),
    "resample": ("Bootstrap", "scheme"),
    "replicates": ("Bootstrap", "replicates"),
    "integrator": ("Exact", "integrator"),
    "kind": ("", "kinds"),
}
_MAPPINGS = ("fix", "prior", "bounds")
_FLAGS = ("force", "independent", "no-facts", "digitised-only", "quick", "raw")


def in_python(text: str) -> str:
    """A message with its options as Python writes them.

    Parameters
    ----------
    text : str
        As the command line has it, with ``--noise unknown``, ``--gamma-min 12``, ``ifrfit compare``.

    Returns
    -------
    str
        With ``noise="unknown"``, ``gamma_min=12``, ``ifrfit.compare``. Options of objects are named with
        them: ``Noise(tails="student-t")``. Whole commands in quotes stay.
    """
    if "--" not in text and "ifrfit " not in text:
        return text
    parts = _COMMANDS.split(text)
    return "".join(part if i % 2 else _words(part) for i, part in enumerate(parts))


def _words(text: str) -> str:
    said = _OPTION.sub(_option, text.replace(" with --out", ""))
    while _OBJECTS.search(said):
        said = _OBJECTS.sub(r"\1(\2, \3)", said)
    while _SAME.search(said):
        said = _SAME.sub(_listed, said)
    return _CALL.sub(
        lambda call: f"ifrfit.{call[1]}(..., {call[2]})" if call[2] else f"ifrfit.{call[1]}", said
    )


def _listed(same: re.Match[str]) -> str:
    before, behind = same[2] or same[3], same[4] or same[5]
    return f"{same[1]}[{before}, {behind}]"


def _option(found: re.Match[str]) -> str:
    name, word = found[1], found[2] or ""
    value = word if word.endswith("=...") else word.rstrip(".,:")
    if (_GRAMMAR.fullmatch(value) and not word.endswith(":")) or name in _FLAGS:
        value = ""
    rest = word[len(value) :]
    if rest and not value:
        rest = f" {rest}"
    owner, field = _FIELDS.get(name, ("", name.replace("-", "_")))
    if name in _FLAGS:
        said = f"{field}=True"
    elif name == "tie" and value:
        constant, _, expression = value.strip("'").partition("=")
        quoted = f'"{expression}"' if expression else "..."
        said = f'{field}={{"{constant}": {quoted}}}'
    elif name in _MAPPINGS and value:
        constant, _, numbers = value.partition("=")
        said = f'{field}={{"{constant}": {_literal(numbers or "...")}}}'
    elif owner:
        said = f"{owner}({field}={_literal(value or '...')})"
    else:
        said = f"{field}={_literal(value)}" if value else field
    return said + rest


def _literal(value: str) -> str:
    """A value as Python writes it: a number, several as a tuple, else a string."""
    bare = value.strip("'")
    if bare == "..." or _PLACEHOLDER.fullmatch(bare):
        return "..."
    if bare in ("nan", "inf", "-inf"):
        return f'float("{bare}")'
    parts = bare.split(",")
    if all(_NUMBER.fullmatch(part) or _PLACEHOLDER.fullmatch(part) for part in parts):
        return parts[0] if len(parts) == 1 else f"({', '.join(parts)})"
    return f'"{bare}"'
