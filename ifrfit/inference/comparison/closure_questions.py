"""One question for every closure: each takes of the user's choices what its constants allow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.estimators import Exact
from ifrfit.inference.fit import Question, fit_problem
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.options import Model
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closure import Closure
from ifrfit.physics.closures import CLOSURES, get_closure
from ifrfit.text import joined


def chosen_closures(
    names: str | Iterable[str] | None, plain: bool
) -> tuple[tuple[Closure, ...], tuple[str, ...]]:
    """Closures of these names, each once; where none is named, all of the registry that know the errors.

    Parameters
    ----------
    names : str or iterable of str, optional
    plain : bool
        Whether errors are independent, Gaussian, and of the values alone.

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
        return known_to(plain)
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


def applied_where(closures: Sequence[Closure], choices: Mapping[str, Iterable[str]]) -> tuple[str, ...]:
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
    question: Question, closures: Sequence[Closure], model: Model, seed: int, command: str
) -> dict[str, FitResult]:
    """Fit every closure by exact posterior.

    Raises
    ------
    UsageError, DataError
        As `ifrfit.fit`; with the name of the closure where another one may well pass.
    """
    own = {c.constant for c in closures if c.constant}
    specific = any(name in own for named in model.named_constants().values() for name in named)
    found: dict[str, FitResult] = {}
    problem: Problem | None = None
    for closure in closures:
        try:
            parameters = model.with_closure(closure).parameters(question.inertia_factor)
            if problem is None:
                problem = question.problem(closure, parameters)
            problem = problem.with_closure(closure, parameters)
            found[closure.name] = fit_problem(
                problem,
                Exact(),
                seed=seed,
                command=command,
                conditions=question.conditions,
                assumed=question.assumed,
            )
        except (UsageError, DataError) as error:
            if not found and not specific:
                raise
            named = str(error).startswith(f"Closure {closure.title} ")
            raise type(error)(str(error) if named else f"Closure {closure.title}: {error}") from None
    return found
