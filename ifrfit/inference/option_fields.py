"""Options as fields of frozen classes: one place for the name, the help and the default of each.

In Python an option is a field of its class, and those of `Model` are keywords of `ifrfit.fit`, too; the
command line takes it as ``--keyword``, from a list that is read from the classes. This module imports nothing
heavy, because ``ifrfit fit --help`` needs it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cache
from numbers import Integral, Real
from os import PathLike
from typing import Any, Literal, TypeVar

from ifrfit.errors import UsageError
from ifrfit.text import number_of

Form = Literal[
    "text",
    "number",
    "fraction",
    "integer",
    "path",
    "names",
    "words",
    "values",
    "pairs",
    "priors",
    "expressions",
    "range",
    "flag",
]

Choices = Callable[[], Iterable[str]]

_KEY, _NESTED = "option", "options"


@dataclass(frozen=True)
class Option:
    """How an option is named and written.

    Attributes
    ----------
    help : str
        One sentence for the help text.
    form : str
        How it is written on the command line. names: NAME, repeatable; words: NAME,NAME, repeatable, of names
        that hold no comma; values: NAME=VALUE, repeatable; pairs: NAME=A,B, repeatable; priors: these, or
        NAME=LAW:A,B; expressions: NAME=EXPRESSION, repeatable; range: LO,HI; flag: no
        value; text, number, integer and path: one such word;
        fraction: a number, also as 2/3.
    metavar : str or None
        Stands for the value in the help text.
    keyword : str
        With dashes the option of the command line. By default the field's name.
    default : object
        Of the field.
    least : int or None
        Smallest value of a number.
    unset : str
        What holds where it is not given and has no default, in a few words.
    choices : callable or None
        Gives the words that it takes, where these are known: it is asked no sooner than they are needed.
    """

    help: str
    form: Form = "text"
    metavar: str | None = None
    keyword: str = ""
    default: object = None
    least: int | None = None
    unset: str = ""
    choices: Choices | None = None

    @property
    def flag(self) -> str:
        """Name on the command line, with its dashes."""
        return "--" + self.keyword.replace("_", "-")

    def is_given(self, value: object) -> bool:
        """Whether a value says anything: neither None, nor empty, nor the default."""
        if value is None or (isinstance(value, Mapping | list | tuple | set | frozenset | str) and not value):
            return False
        return bool(value != self.default)


def option(
    default: Any,
    help: str,
    *,
    form: Form = "text",
    metavar: str | None = None,
    keyword: str = "",
    least: int | None = None,
    unset: str = "",
    choices: Choices | None = None,
) -> Any:
    """A field of a dataclass that is an option; the arguments are those of `Option`."""
    metadata = {_KEY: Option(help, form, metavar, keyword, least=least, unset=unset, choices=choices)}
    if isinstance(default, dict):
        return field(default_factory=dict, metadata=metadata)
    return field(default=default, metadata=metadata)


def nested(owner: type) -> Any:
    """A field of a dataclass that holds an object with options of its own, or None."""
    return field(default=None, metadata={_NESTED: owner})


class Options:
    """Base of the classes whose fields are options: shown with what differs from the defaults only.

    Raises
    ------
    UsageError
        For a value that is not of the form of its option or of its class, and a number below its least value.
    """

    def __post_init__(self) -> None:
        for each in fields(self):  # type: ignore[arg-type]
            owner, value = each.metadata.get(_NESTED), getattr(self, each.name)
            if owner is not None and value is not None and not isinstance(value, owner):
                raise UsageError(
                    f"{type(self).__name__}({each.name}=...): {value!r:.40} is no {owner.__name__}. Give "
                    f"ifrfit.{owner.__name__}({value!r:.40})."
                )
        for name, stated, is_checked in _own_options(type(self)):  # type: ignore[arg-type]
            value = getattr(self, name)
            if value is None:
                continue
            if is_checked:
                check_form(stated.flag, stated.form, value)
            if stated.least is not None and value < stated.least:
                raise UsageError(f"{stated.flag} {value}: it must be {stated.least} or more.")

    def __repr__(self) -> str:
        values = ((each, getattr(self, each.name)) for each in fields(self))  # type: ignore[arg-type]
        shown = ", ".join(f"{each.name}={value!r}" for each, value in values if value != _default(each))
        return f"{type(self).__name__}({shown})"


def options_of(owner: type) -> dict[str, Option]:
    """Options of a class by keyword, those of nested objects included.

    Parameters
    ----------
    owner : type
        A dataclass; fields made otherwise than by `option` and `nested` are none.
    """
    own = {name: stated for name, stated, _ in _own_options(owner)}
    found: dict[str, Option] = {}
    for each in fields(owner):
        if each.name in own:
            found[own[each.name].keyword] = own[each.name]
        elif _NESTED in each.metadata:
            found |= options_of(each.metadata[_NESTED])
    return found


@cache
def _own_options(owner: type) -> tuple[tuple[str, Option, bool], ...]:
    """Fields of a class that are options, each with its option, and whether its form is looked at."""
    found = []
    for each in fields(owner):
        if _KEY in each.metadata:
            stated: Option = each.metadata[_KEY]
            stated = replace(stated, keyword=stated.keyword or each.name, default=_default(each))
            # a text may as well be a number where its annotation says so, as a budget in seconds
            is_checked = stated.form != "text" or each.type in ("str", "str | None")
            found.append((each.name, stated, is_checked))
    return tuple(found)


def given(owner: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Of some keywords those that are options of a class and say anything."""
    options = options_of(owner)
    return {key: value for key, value in values.items() if key in options and options[key].is_given(value)}


def plain(value: Any) -> Any:
    """A list in the place of an array or a column of names or numbers."""
    return value.tolist() if hasattr(value, "tolist") and hasattr(value, "dtype") else value


def check_form(flag: str, form: Form, value: object) -> None:
    """Refuse a value that is not of the form of its option: on the command line it could not be written.

    Raises
    ------
    UsageError
        With what it is to be.
    """
    if form in _NAMED and isinstance(value, Mapping):
        for name, own in value.items():
            if not _NAMED[form](own):
                raise UsageError(f"{flag} {name}: {own!r:.60} is not {_FORMS[form][1]}.")
    elif not _FORMS[form][0](value):
        raise UsageError(f"{flag}: {value!r:.60} is not {_FORMS[form][2]}.")


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_pair(value: object) -> bool:
    return (
        not isinstance(value, str | Mapping)
        and isinstance(value, Collection)
        and len(value) == 2
        and all(map(_is_number, value))
    )


def _is_names(value: object) -> bool:
    if isinstance(value, str):
        return True
    return (
        isinstance(value, Collection)
        and not isinstance(value, Mapping)
        and all(isinstance(name, str) for name in value)
    )


def _is_prior(value: object) -> bool:
    return _is_pair(value) or (hasattr(value, "moments") and not isinstance(value, type))


def _is_text(value: object) -> bool:
    return isinstance(value, str)


_NAMED: dict[str, Callable[[object], bool]] = {
    "values": _is_number,
    "pairs": _is_pair,
    "priors": _is_prior,
    "expressions": _is_text,
}
# form: whether a value has it; what one of a mapping is to be; what the whole is to be
_FORMS: dict[str, tuple[Callable[[object], bool], str, str]] = {
    "text": (lambda value: isinstance(value, str), "", "a word"),
    "number": (_is_number, "", "a number"),
    "fraction": (lambda value: number_of(value) is not None, "", "a number, nor two as 2/3"),
    "integer": (lambda value: _is_number(value) and isinstance(value, Integral), "", "a whole number"),
    "path": (lambda value: isinstance(value, str | PathLike), "", "a path"),
    "names": (_is_names, "", "a name or several names"),
    "words": (_is_names, "", "a name or several names"),
    "values": (lambda value: False, "a number", 'a mapping of constants to numbers, as {"e_n": 0.94}'),
    "pairs": (
        lambda value: False,
        "two numbers",
        'a mapping of constants to two numbers, as {"mu": (0.1, 0.02)}',
    ),
    "priors": (
        lambda value: False,
        "two numbers, mean and sd, nor a law as ifrfit.LogNormal(0.1, 0.3)",
        'a mapping of constants to priors, as {"mu": (0.1, 0.02)}',
    ),
    "expressions": (
        lambda value: False,
        'an expression, as "-1 + 0.1*mu"',
        'a mapping of constants to expressions, as {"e_t": "-1 + 0.1*mu"}',
    ),
    "range": (_is_pair, "", "two numbers"),
    "flag": (lambda value: isinstance(value, int), "", "True or False"),
}

T = TypeVar("T")


def build(owner: type[T], values: Mapping[str, Any]) -> T:
    """An object of a class from keywords; those that are no options of the class are left alone.

    Raises
    ------
    UsageError
        As the class.
    """
    said = given(owner, values)
    made: dict[str, Any] = {}
    for each in fields(owner):  # type: ignore[arg-type]
        if _KEY in each.metadata:
            keyword = each.metadata[_KEY].keyword or each.name
            if keyword in said:
                made[each.name] = said[keyword]
        elif _NESTED in each.metadata and given(each.metadata[_NESTED], said):
            made[each.name] = build(each.metadata[_NESTED], said)
    return owner(**made)


def _default(each: Any) -> Any:
    return each.default if each.default_factory is MISSING else each.default_factory()
