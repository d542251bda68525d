"""What options of several commands share: their forms, and how their text is read."""

from __future__ import annotations

import functools
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from ifrfit.cli.completion import complete_data, completer
from ifrfit.cli.grouped_help import GroupedCommand
from ifrfit.cli.output import command
from ifrfit.cli.parameters import (
    DATA,
    METHOD,
    MODEL,
    NOISE,
    NOT_NEGATIVE,
    PATH,
    Argument,
    GroupedOption,
    Whole,
    option,
)
from ifrfit.errors import UsageError
from ifrfit.inference.option_fields import Form, Option, build, options_of

workers_option = option(
    "--workers",
    type=Whole(min=1),
    default=1,
    metavar="N",
    help="Processes that fit groups, or read data not held in memory; no number depends on them.",
    group=METHOD,
)
scheduler_option = option(
    "--scheduler",
    metavar="ADDRESS",
    help="Dask scheduler whose workers do so, as tcp://host:8786.  [default: none]",
    group=METHOD,
)


def pairs(option: str, given: Sequence[str], form: str) -> dict[str, Any]:
    """NAME=VALUE, or NAME=A,B, as a dictionary."""
    numbers = form.count(",") + 1
    found: dict[str, Any] = {}
    for text in given:
        name, equals, rest = text.partition("=")
        try:
            values = [float(part) for part in rest.split(",")]
        except ValueError:
            values = []
        if not equals or len(values) != numbers:
            raise UsageError(f"{option} {text}: write it as {form}, with decimal points.")
        if name in found:
            raise UsageError(f"{option} {name} is given twice.")
        found[name] = values[0] if numbers == 1 else tuple(values)
    return found


def priors(option: str, given: Sequence[str], form: str) -> dict[str, Any]:
    """NAME=MEAN,SD, or NAME=LAW:NUMBERS, as a dictionary."""
    laws = {name: rest for name, _, rest in (text.partition("=") for text in given) if ":" in rest}
    plain = [text for text in given if text.partition("=")[0] not in laws]
    found = pairs(option, plain, form)
    if len(found) + len(laws) < len(given):
        raise UsageError(f"{option} {next(iter(laws))} is given twice.")
    if laws:
        from ifrfit.inference.model.prior_laws import read_law

        found |= {name: read_law(text) for name, text in laws.items()}
    return found


def expressions(option: str, given: Sequence[str]) -> dict[str, str]:
    """NAME=EXPRESSION as a dictionary."""
    found: dict[str, str] = {}
    for text in given:
        name, equals, rest = (part.strip() for part in text.partition("="))
        if not equals or not rest:
            raise UsageError(f"{option} {text}: write it as NAME=EXPRESSION, as 'e_t=-1 + 0.1*mu'.")
        if name in found:
            raise UsageError(f"{option} {name} is given twice.")
        found[name] = rest
    return found


def ends(option: str, text: str | None) -> tuple[float, float] | None:
    """LO,HI as two numbers."""
    if text is None:
        return None
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"{option} {text}: write it as LO,HI, with decimal points.") from None
    return low, high


_MOST_NUMBERS = 1_000_000


def numbers(option: str, text: str) -> list[float]:
    """Numbers from ``1,2,3`` or ``from:to:step``."""
    import numpy as np

    try:
        if ":" in text:
            low, high, step = (float(part) for part in text.split(":"))
            if not (step > 0.0 and low <= high < np.inf):
                raise ValueError
        else:
            return [float(part) for part in text.split(",")]
    except ValueError:
        raise UsageError(f"{option} {text}: write numbers as 10,20,30 or as FROM:TO:STEP.") from None
    if (high - low) / step >= _MOST_NUMBERS:
        raise UsageError(f"{option} {text}: more than {_MOST_NUMBERS:,} numbers. Take a larger step.")
    return [float(x) for x in np.arange(low, high + 0.5 * step, step)]


def command_line() -> str:
    """The command as text, for the record; file names that are no UTF-8 lose those bytes."""
    return shlex.join(["ifrfit", *sys.argv[1:]]).encode("utf-8", "replace").decode("utf-8")


def words(given: Sequence[str]) -> list[str]:
    """Names that were given one by one or with commas between."""
    return [word.strip() for text in given for word in text.split(",") if word.strip()]


def are_streamed(data: Sequence[str]) -> bool:
    """Whether the data of a command are not held in memory."""
    if len(data) != 1:
        return False
    from ifrfit.data.stream.files import is_stream

    return is_stream(Path(data[0]))


def _observables() -> Iterable[str]:
    from ifrfit.physics.observables import OBSERVABLES

    return OBSERVABLES


def offered_conventions() -> Iterable[str]:
    """Conventions whose choice is a word."""
    from ifrfit.data.convention_meanings import WORDS

    return WORDS


# options of the rows that are used, and of the run
_ROWS = (
    Option(
        "Use only these observables.",
        "words",
        "NAME,...",
        "observable",
        unset="all, or as the dataset says",
        choices=_observables,
    ),
    Option("Use only this series.", "names", "NAME", "series", unset="all, or as the dataset says"),
    Option("Use only impacts at this angle or more.", "number", "DEG", "gamma_min", unset="0"),
    Option("Use only impacts at this angle or less.", "number", "DEG", "gamma_max", unset="90"),
    Option("Use only impacts at this speed or more.", "number", "M_S", "speed_min", unset="any"),
    Option("Use only impacts at this speed or less.", "number", "M_S", "speed_max", unset="any"),
    Option("Leave out a line of the file, FILE:LINE, or an impact.", "names", "ROW|ID", "exclude"),
    Option("Count faces of the same impacts as independent.", "flag", None, "independent", False),
    Option(
        "How a column is meant; 'ifrfit conventions' lists all.",
        "names",
        "NAME=CHOICE",
        "convention",
        choices=offered_conventions,
    ),
)
# of files that are no tables of impacts by themselves; each is a convention of that name,
# of one of several files as FILE:CHOICE
_FILES = (
    Option("Of a digitised figure, what its x axis is.", "names", "HEADER", "x"),
    Option("Of a digitised figure, what its y axis is.", "names", "HEADER", "y"),
    Option("Of a figure with several axes, which.", "names", "NAME", "axes", unset="those with points"),
    Option("Of a digitised figure, which dataset.", "names", "NAME", "dataset", unset="all"),
    Option("Of a digitised figure, the standard error of a click.", "names", "N", "pixels", unset="1"),
    Option(
        "Of a digitised figure, what half an error bar is.",
        "names",
        "sigma|2sigma|95%",
        "bars",
        unset="left out",
    ),
    Option("Of a spreadsheet, which sheet.", "names", "NAME", "sheet", unset="the only one"),
)
_SCENE = Option(
    "What hit what, to see which effects that calls for.",
    "path",
    "SCENE.toml",
    "scene",
    unset="as the dataset says",
)


def figure_conventions(**given: Any) -> list[str]:
    """Options of `_FILES`, by keyword, as the conventions that the library takes."""
    return [
        f"{key}={each}"
        for key, value in given.items()
        if value is not None
        for each in (value if isinstance(value, list | tuple) else [value])
    ]


class SharedCommand:
    """A command that puts a question to data: its options are its own and those of the question.

    The latter come from the fields of `Model`, `Noise` and, for `fit`, of the methods. They are looked up
    when the command is made: methods may be registered after this module was imported.

    Parameters
    ----------
    run : callable
        The command, decorated with its own options. It takes ``question``, the keywords of the library by
        name, and those options.
    closure : bool
        Whether it takes one closure.
    methods : bool
        Whether it takes a method with its options: then ``question`` holds the object as ``method``.
    ties : bool
        Whether constants may be tied.
    """

    def __init__(
        self,
        run: Callable[..., None],
        *,
        closure: bool = True,
        methods: bool = False,
        ties: bool = False,
    ) -> None:
        functools.update_wrapper(self, run)
        self._run = run
        self._closure = closure
        self._methods = methods
        self._ties = ties

    def made(self, name: str) -> GroupedCommand:
        """The command with all its options, those of the question first."""
        made: GroupedCommand = click.command(name, cls=GroupedCommand)(command(self))
        made.params[:0] = self._shared()
        return made

    def _model(self) -> dict[str, Option]:
        from ifrfit.inference.options import Model

        found = options_of(Model)
        if not self._closure:
            del found["closure"]
        if not self._ties:
            del found["tie"]
        return found

    def _shared(self) -> Iterator[click.Parameter]:
        """Data, model, noise, method."""
        from ifrfit.inference.estimators import method_options
        from ifrfit.inference.options import Noise

        yield Argument(
            ["data"],
            nargs=-1,
            required=True,
            metavar="DATA...",
            help="Files, or names of bundled datasets.",
            complete=complete_data,
        )
        yield from (_parameter(each, DATA) for each in (*_ROWS, *_FILES, _SCENE))
        yield from (_parameter(each, MODEL) for each in self._model().values())
        yield from (_parameter(each, NOISE) for each in options_of(Noise).values())
        if self._methods:
            yield _method()
            yield from (_parameter(each, METHOD) for each in method_options().values())
        yield GroupedOption(
            ["--seed"],
            type=NOT_NEGATIVE,
            default=0,
            metavar="N",
            help="Seed of the random draws behind the bands.",
            group=METHOD,
        )

    def __call__(self, **given: Any) -> None:
        """Run the command with what the command line gave."""
        from ifrfit.inference.estimators import make_estimator, method_options
        from ifrfit.inference.options import Model, Noise

        options = self._model() | options_of(Noise) | (method_options() if self._methods else {})
        values = {key: _read(option, given.pop(key)) for key, option in options.items()}
        question = {
            key: given.pop(key) for key in ("data", *(each.keyword for each in _ROWS), "scene", "seed")
        }
        question["observable"] = words(question["observable"])
        of_file = figure_conventions(**{each.keyword: given.pop(each.keyword) for each in _FILES})
        question["convention"] = [*question["convention"], *of_file]
        question["model"] = build(Model, values)
        question["noise"] = build(Noise, values)
        if self._methods:
            question["method"] = make_estimator(given.pop("method"), values)
        self._run(question, **given)


# how click takes an option, by its form
_REPEATABLE: Mapping[str, Any] = {"multiple": True}
_FORMS: Mapping[Form, Mapping[str, Any]] = {
    "text": {},
    "number": {"type": float},
    "fraction": {},
    "integer": {"type": int},
    "path": {"type": PATH},
    "names": _REPEATABLE,
    "words": _REPEATABLE,
    "values": _REPEATABLE,
    "pairs": _REPEATABLE,
    "priors": _REPEATABLE,
    "expressions": _REPEATABLE,
    "range": {},
    "flag": {"is_flag": True},
}


# what stands for the value in the help text where the option does not say
_METAVARS: Mapping[Form, str] = {"text": "NAME", "number": "X", "integer": "N", "path": "PATH"}


def _parameter(option: Option, group: str) -> GroupedOption:
    form = _FORMS[option.form]
    if option.default is not None and form is not _REPEATABLE:
        form = {**form, "default": option.default}
    return GroupedOption(
        [option.keyword, option.flag],
        **form,
        metavar=option.metavar or _METAVARS.get(option.form),
        help=_with_default(option),
        show_default=False,
        complete=completer(option.choices, option.form) if option.choices else None,
        group=group,
    )


def _with_default(option: Option) -> str:
    """The help of an option, with what holds where it is not given."""
    if option.form == "flag":
        return option.help
    often = "repeatable; " if _FORMS[option.form] is _REPEATABLE else ""
    default = str(option.default) if isinstance(option.default, str | int | float) else option.unset or "none"
    return f"{option.help}  [{often}default: {default}]"


def _method() -> GroupedOption:
    from ifrfit.inference.estimators import ESTIMATORS, Exact

    said = [f"{name}: {each.summary}" for name, each in ESTIMATORS.items()]
    return GroupedOption(
        ["--method"],
        metavar="NAME",
        help=f"{'; '.join(said)}.  [default: {Exact.name}]",
        complete=completer(lambda: ESTIMATORS),
        group=METHOD,
    )


def _read(option: Option, value: Any) -> Any:
    """A value of the library from what the command line gave."""
    if option.form in ("values", "pairs"):
        return pairs(option.flag, value, str(option.metavar))
    if option.form == "priors":
        return priors(option.flag, value, str(option.metavar))
    if option.form == "expressions":
        return expressions(option.flag, value)
    if option.form == "words":
        return words(value)
    return ends(option.flag, value) if option.form == "range" else value
