"""One question for every closure: each takes of the user's choices what its constants allow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ifrfit.data import Observations
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.fit import fit
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closures import CLOSURES, Closure, get_closure
from ifrfit.text import joined

_BY_NAME = ("fix", "prior", "bounds")


def chosen_closures(
    names: str | Iterable[str] | None, choices: Mapping[str, Any]
) -> tuple[tuple[Closure, ...], tuple[str, ...]]:
    """Closures of these names, each once; where none is named, all of the registry that know the scatter.

    Returns
    -------
    closures : tuple of Closure
    notes : tuple of str
        Which were left out.

    Raises
    ------
    UsageError
        For an unknown name, or where there is only one.
    """
    given = [] if names is None else [names] if isinstance(names, str) else list(names)
    if not given:
        plain = choices.get("tails", "gaussian") == "gaussian"
        return known_to(plain and choices.get("angle_errors", "none") == "none")
    found = tuple({c.name: c for c in map(get_closure, given)}.values())
    if len(found) < 2:
        raise UsageError(
            f"Only closure {found[0].title} is named, so there is nothing to compare it with. Name two or "
            "more, or none for all."
        )
    return found, ()


def known_to(plain: bool) -> tuple[tuple[Closure, ...], tuple[str, ...]]:
    """All closures that know a scatter, plain or not, and which were left out."""
    every = tuple(CLOSURES.values())
    if plain:
        return every, ()
    said = tuple(
        f"{c.title} is left out: it knows independent Gaussian errors of the values only."
        for c in every
        if not c.bilinear
    )
    return tuple(c for c in every if c.bilinear), said


def constant_choices(choices: Mapping[str, Any]) -> dict[str, Any]:
    """The choices that name constants: fix, prior and bounds as dictionaries, separate as a tuple."""
    found: dict[str, Any] = {key: dict(choices.get(key) or {}) for key in _BY_NAME}
    if choices.get("params") is not None:
        from ifrfit.inference.io.lmfit import constants_from

        for key, value in constants_from(choices["params"]).items():
            found[key] = value | found[key]
    separate = choices.get("separate") or ()
    found["separate"] = (separate,) if isinstance(separate, str) else tuple(separate)
    return found


def applied_where(closures: Sequence[Closure], choices: Mapping[str, Any]) -> tuple[str, ...]:
    """Say of each constant that only some closures have to which of them the user's choice applies.

    Raises
    ------
    UsageError
        For a constant that none of the closures has.
    """
    said = []
    for option, named in choices.items():
        for name in named:
            those = [c.title for c in closures if name in c.constants]
            others = [c.title for c in closures if name not in c.constants]
            if not those:
                known = dict.fromkeys(n for c in closures for n in c.constants)
                raise UsageError(
                    f"--{option} {name}: no closure of this comparison has such a constant. "
                    f"They have {', '.join(known)}."
                )
            if others:
                have = "has" if len(others) == 1 else "have"
                said.append(
                    f"--{option} {name} holds for {joined(those)}; {joined(others)} {have} no such constant."
                )
    return tuple(said)


def fit_each(
    data: Observations, closures: Sequence[Closure], constants: Mapping[str, Any], choices: Mapping[str, Any]
) -> dict[str, FitResult]:
    """Fit every closure by exact posterior.

    Raises
    ------
    UsageError, DataError
        As `fit`; with the name of the closure where another one may well pass.
    """
    own = {c.constant for c in closures if c.constant}
    specific = any(name in own for named in constants.values() for name in named)
    found: dict[str, FitResult] = {}
    for closure in closures:
        try:
            found[closure.name] = fit(
                data, closure=closure.name, method="exact", **choices, **choices_for(closure, constants)
            )
        except (UsageError, DataError) as error:
            if not found and not specific:
                raise
            named = str(error).startswith(f"Closure {closure.title} ")
            raise type(error)(str(error) if named else f"Closure {closure.title}: {error}") from None
    return found


def choices_for(closure: Closure, constants: Mapping[str, Any]) -> dict[str, Any]:
    """What of `constant_choices` holds for this closure."""
    kept = {key: {n: v for n, v in constants[key].items() if n in closure.constants} for key in _BY_NAME}
    return {**kept, "separate": tuple(n for n in constants["separate"] if n in closure.constants)}
