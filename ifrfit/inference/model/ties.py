"""Ties: constants that are expressions of others, in the syntax of lmfit.

An expression is parsed, its parts are looked at one by one, and what is not arithmetic with constants,
numbers and a few functions is refused before asteval computes it; nothing of Python is ever evaluated.
"""

from __future__ import annotations

import ast
import itertools
import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.model.entry_names import quantity_of, split_name
from ifrfit.text import joined, meant

if TYPE_CHECKING:
    from asteval import Interpreter

Array = NDArray[np.float64]

FUNCTIONS = {"exp": np.exp, "log": np.log, "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "tan": np.tan}
_LONGEST = 200  # characters of an expression that a person wrote
_ALLOWED = (
    ast.Expression,
    ast.BinOp,
    ast.UnaryOp,
    ast.Constant,
    ast.Name,
    ast.Load,
    ast.Call,
    ast.Add,
    ast.Sub,
    ast.Mult,
    ast.Div,
    ast.Pow,
    ast.USub,
    ast.UAdd,
)
_STEP = 6e-6  # relative, of central differences: the third root of the rounding


@dataclass(frozen=True)
class Ties:
    """Entries of theta that follow from others.

    Attributes
    ----------
    names : tuple of str
        Of all entries of theta.
    expressions : mapping of str to str
        Tied entry to its expression.
    """

    names: tuple[str, ...]
    expressions: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def tied(self) -> NDArray[np.bool_]:
        """Which entries are tied, (p,)."""
        return np.array([name in self.expressions for name in self.names])

    @cached_property
    def involved(self) -> frozenset[str]:
        """Constants that a tie sets or names, without their series."""
        used = (names_in(name, text, self.names) for name, text in self.expressions.items())
        return frozenset(quantity_of(name) for name in (*self.expressions, *itertools.chain(*used)))

    def check(self, fixed: Sequence[str], with_prior: Sequence[str]) -> None:
        """Refuse ties that say nothing, go round in circles, or contradict what else is said.

        Parameters
        ----------
        fixed, with_prior : sequence of str
            Entries that are fixed, and those with a prior.

        Raises
        ------
        UsageError
            With the tie and the remedy.
        """
        for name, text in self.expressions.items():
            if name not in self.names:
                raise UsageError(
                    f"--tie '{name}={text}': there is no constant {name}. There are {joined(self.names)}."
                    f"{_hint(name, self.names)}"
                )
            used = names_in(name, text, self.names)
            if not used:
                raise UsageError(f"--tie '{name}={text}': names no other constant. {_instead(name)}")
            for option, others in (("fix", fixed), ("prior", with_prior)):
                if name in others:
                    raise UsageError(
                        f"--tie '{name}={text}' contradicts --{option} of {name}: keep one. A prior of what "
                        "it is tied to is fine."
                    )
        _ = self._order

    @cached_property
    def _order(self) -> tuple[str, ...]:
        """Tied entries, each behind those that it names."""
        left = {name: set(names_in(name, text, self.names)) for name, text in self.expressions.items()}
        found: list[str] = []
        while left:
            ready = [name for name, used in left.items() if not used & left.keys()]
            if not ready:
                name, used = next(iter(left.items()))
                what = f"ties {name} to itself" if name in used else f"a circle of {joined([*left])}"
                raise UsageError(f"--tie '{name}={self.expressions[name]}': {what}. Leave one free.")
            found += ready
            left = {name: used for name, used in left.items() if name not in ready}
        return tuple(found)

    def following(self, free: Collection[str]) -> tuple[str, ...]:
        """Tied entries that follow from free ones; the others follow from fixed ones, and stand still."""
        moving = set(free)
        for name in self._order:
            if moving & set(names_in(name, self.expressions[name], self.names)):
                moving.add(name)
        return tuple(name for name in self.expressions if name in moving)

    def applied(self, theta: Array) -> Array:
        """Entries of theta, (m, p), with the tied ones worked out; nan where an expression has no value."""
        theta = np.array(theta, dtype=float)
        with np.errstate(all="ignore"):
            for name in self._order:
                place = self.names.index(name)
                value = np.asarray(_value(name, self.expressions[name], self.names, theta), dtype=float)
                theta[:, place] = np.broadcast_to(value, theta.shape[:1])
        return theta

    def slopes(self, theta: Array, free: NDArray[np.bool_]) -> Array:
        """Derivative of theta, (p,), by its free entries, (p, k), by central differences."""
        places = np.flatnonzero(free)
        steps = _STEP * np.maximum(1.0, np.abs(theta[places]))
        moved = np.tile(theta, (2 * places.size, 1))
        moved[np.arange(places.size), places] += steps
        moved[places.size + np.arange(places.size), places] -= steps
        up, down = np.split(self.applied(moved), 2) if places.size else (moved, moved)
        return np.asarray(((up - down) / (2.0 * steps[:, None])).T)


def _instead(name: str) -> str:
    """What gives a constant a value, in the place of a tie to a number."""
    quantity, label = split_name(name)
    if not label:
        return f"Use --fix {name}=VALUE."
    return (
        f"Use --fix {quantity}=VALUE, which is of all series; for {label} alone, fit it on its own, "
        f"--series {shlex.quote(label)}."
    )


def names_in(name: str, text: str, names: Sequence[str]) -> tuple[str, ...]:
    """The constants that an expression names.

    Raises
    ------
    UsageError
        For what is no arithmetic, and for unknown names.
    """
    return _parsed(name, text, names)[1]


def _parsed(name: str, text: str, names: Sequence[str]) -> tuple[str, tuple[str, ...]]:
    """The expression with a plain word for each constant, and the constants that it names."""
    said = f"--tie '{name}={_shown(text)}'"
    if len(text) > _LONGEST:
        raise UsageError(f"--tie {name}: give an expression of up to {_LONGEST} characters, as -1 + 0.1*mu.")
    plain = text
    for place in sorted(range(len(names)), key=lambda i: -len(names[i])):
        if "[" in names[place]:
            plain = plain.replace(names[place], _word(place))
    try:
        tree = ast.parse(plain.strip(), mode="eval")
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise UsageError(f"{said}: is no expression. Write it as -1 + 0.1*mu.") from None
    words = {own if "[" not in own else _word(place): own for place, own in enumerate(names)}
    used: list[str] = []
    for node in ast.walk(tree):
        is_number = isinstance(node, ast.Constant) and isinstance(node.value, int | float)
        if not isinstance(node, _ALLOWED) or (isinstance(node, ast.Constant) and not is_number):
            raise UsageError(
                f"{said}: knows numbers, constants, + - * / **, and {joined([*FUNCTIONS])} of one number."
            )
        if isinstance(node, ast.Call):
            known = isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS
            if not known or node.keywords or len(node.args) != 1:
                raise UsageError(f"{said}: knows the functions {joined([*FUNCTIONS])}, each of one number.")
        if isinstance(node, ast.Name) and node.id not in FUNCTIONS:
            if node.id not in words:
                raise UsageError(
                    f"{said}: there is no constant {node.id}. There are {joined(names)}."
                    f"{_hint(node.id, names)}"
                )
            used.append(words[node.id])
    return plain, tuple(dict.fromkeys(used))


def _shown(text: str) -> str:
    """An expression in a message, where it stands in quotes."""
    return text.replace("'", "").replace('"', "")


def _hint(name: str, names: Sequence[str]) -> str:
    return meant(name, list(names))


def _word(place: int) -> str:
    """Stands for an entry whose name is no word of an expression."""
    return f"entry_{place}_"


@lru_cache(maxsize=64)
def _program(name: str, text: str, names: tuple[str, ...]) -> tuple[Interpreter, ast.AST, dict[str, int]]:
    """What works out an expression, the expression for it, and the words that stand for entries of theta."""
    from asteval import Interpreter

    plain, used = _parsed(name, text, names)
    places = {own: names.index(own) for own in used}
    words = {own if "[" not in own else _word(place): place for own, place in places.items()}
    evaluate = Interpreter(symtable=dict(FUNCTIONS), minimal=True, use_numpy=False)
    return evaluate, evaluate.parse(plain.strip()), words


def _value(name: str, text: str, names: tuple[str, ...], theta: Array) -> Any:
    evaluate, tree, words = _program(name, text, names)
    evaluate.symtable.update({word: theta[:, place] for word, place in words.items()})
    evaluate.error = []
    found = evaluate.run(tree, with_raise=False)
    return np.nan if evaluate.error or found is None else found
