"""`compare`: closures side by side on the same impacts."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np
from scipy import special

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.comparison.loo import loo_of, with_differences
from ifrfit.inference.comparison.prior_sensitivity import (
    optima_beyond_priors,
    prior_of,
    prior_table,
    words_beside_criteria,
)
from ifrfit.inference.comparison.psi_plane import psi_plane
from ifrfit.inference.comparison.reservations import with_reservations
from ifrfit.inference.comparison.result import HOPELESS, Comparison, Entry, Loo, PsiPlane
from ifrfit.inference.comparison.verdict import verdict_of
from ifrfit.inference.estimations import posterior_estimation
from ifrfit.inference.estimators import Exact
from ifrfit.inference.fit import (
    Data,
    Question,
    asked_of_stream,
    fit_problem,
    make_question,
    open_stream,
    stream_path,
)
from ifrfit.inference.keywords import QuestionKeywords, model_of, noise_of, split_columns
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.notebook_progress import shown_in_notebook
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.option_fields import check_form, plain
from ifrfit.inference.options import Model, Noise
from ifrfit.inference.posterior import ExactPosterior, exact_posterior
from ifrfit.inference.result.build import build_result
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.restore import posterior_of
from ifrfit.inference.result.restore import question as question_of
from ifrfit.physics.closure import Closure
from ifrfit.physics.closures import CLOSURES, get_closure
from ifrfit.text import joined

if TYPE_CHECKING:
    from ifrfit.inference.sufficient_statistics.passes import Reader

_NO_OBLIQUE = "No row is of an oblique impact: e_n and mu alone say nothing of a closure."
_TOO_MANY = "Too many rows for cross-validation by draws: with so many the evidence decides."
_TOLERANCE = 1e-2  # of a result's closures: of the log evidence and, in sd, of the constants

Progress = Callable[[int, int], None]


class ComparisonInterrupted(KeyboardInterrupt):
    """A comparison that was interrupted, and what it had compared.

    Attributes
    ----------
    so_far : Comparison
    """

    def __init__(self, said: str, so_far: Comparison) -> None:
        super().__init__(said)
        self.so_far = so_far


def compare(
    data: Data | Sequence[Data] | None = None,
    closures: str | Iterable[str] | None = None,
    *,
    model: Model | None = None,
    noise: str | Noise | None = None,
    loo: bool = True,
    workers: int = 1,
    scheduler: str | None = None,
    seed: int = 0,
    scene: str | Path | None = None,
    command: str = "",
    progress: Progress | None = None,
    **keywords: Unpack[QuestionKeywords],
) -> Comparison:
    """Weigh closures against each other by what they say of the same impacts.

    Parameters
    ----------
    data : str, Path, table, Observations, or a sequence of them
        As `fit`.
    closures : iterable of str, optional
        Two or more; all there are by default.
    model : Model, optional
        As `fit`; its closure does not matter. A choice for a constant that only some closures have applies to
        these, which is noted.
    noise : {"known", "scaled", "unknown", "mixed"} or Noise, optional
        As `fit`.
    loo : bool
        Whether to cross-validate by leaving impacts out (needs ArviZ's statistics; takes longer).
    workers : int
        Processes that read data not held in memory; no number depends on them.
    scheduler : str, optional
        Address of a Dask scheduler whose workers do so, as ``tcp://host:8786``.
    seed : int
        Of the draws behind bands and cross-validation.
    scene, command
        As `fit`.
    progress : callable, optional
        Called with the closures fitted and cross-validated, and how many there are to be; of data not held in
        memory with rows.
    **keywords
        Those of `fit` but for closure and the options of methods.

    Returns
    -------
    Comparison

    Raises
    ------
    UsageError
        For choices that do not exist or contradict, or fewer than two closures.
    DataError
        For data that are refused.
    ComparisonInterrupted
        By Ctrl-C, with what was compared until then.

    Notes
    -----
    The evidence is the integral of the likelihood over the normalised prior, by the quadrature of the exact
    posterior. Posterior probabilities take all closures as equally probable before. How far the evidence
    rests on the widths of the priors is in `Comparison.priors`.

    Examples
    --------
    >>> import ifrfit
    >>> both = ifrfit.compare("cornell-glass", ["ifr", "f"], loo=False)
    >>> both.ranked
    ('ifr', 'f')
    """
    if "method" in keywords or "closure" in keywords:
        raise UsageError(
            "A comparison is by exact posterior, and `closures` names its closures: leave out `method` and "
            "`closure`."
        )
    check_form("--loo", "flag", plain(loo))
    check_form("--workers", "integer", workers)
    data, options = split_columns("compare", QuestionKeywords, data, keywords)
    chosen, scatter = model_of(model, options), noise_of(noise)
    if chosen.tie:
        raise UsageError("A comparison is by exact posterior, which does not know --tie. Leave it out.")
    asked, notes = chosen_closures(closures, scatter.is_plain)
    path = stream_path(data)
    stream = None if path is None else open_stream(path, chosen, scatter, options)
    if stream is not None:
        from ifrfit.inference.sufficient_statistics.passes import Reader
        from ifrfit.inference.workers.crews import crew_of

        asked, uncompared = (asked, "") if closures else _linear(asked)
        notes += applied_where(asked, chosen.named_constants())
        with (
            shown_in_notebook(progress, "comparing", "rows") as seen,
            crew_of(workers, scheduler) as crew,
        ):
            reader = Reader(stream, crew, None, seen)
            return _compare_stream(reader, asked, chosen, scatter, notes, uncompared, seed, command)
    if workers > 1 or scheduler is not None:
        given = "workers" if workers > 1 else "scheduler"
        raise UsageError(
            f"--{given}: these data are held in memory, and compared by one process. Leave it out."
        )
    notes += applied_where(asked, chosen.named_constants())
    question = make_question(data, chosen, scatter, seed, scene, options)
    fits: dict[str, FitResult] = {}
    stages = len(asked) * (1 + loo)

    try:
        with shown_in_notebook(progress, "comparing", "stages") as seen:

            def tell(done: int) -> None:
                if seen is not None:
                    seen(done, stages)

            fit_each(question, asked, chosen, seed, command, fits, tell)
            return _weighed(fits, notes, loo, seed, lambda done: tell(len(asked) + done))
    except KeyboardInterrupt:
        if len(fits) < 2:
            raise
        missing = [closure.title for closure in asked if closure.name not in fits]
        left_out = [f"{joined(missing)} not fitted"] if missing else []
        left_out += ["nothing cross-validated"] if loo else []
        said = f"Interrupted: {', '.join(left_out)}."
        raise ComparisonInterrupted(said, _weighed(fits, (*notes, said), loo=False, seed=seed)) from None


def _linear(closures: Sequence[Closure]) -> tuple[tuple[Closure, ...], str]:
    """Closures whose sums decide, and what is said of the others, which are left out."""
    others = [c.title for c in closures if not c.bilinear]
    verb, rows = ("is", "needs its") if len(others) == 1 else ("are", "need their")
    said = f"{joined(others)} {verb} not compared: {rows} rows one by one, which are not held in memory."
    return tuple(c for c in closures if c.bilinear), said if others else ""


def _compare_stream(
    reader: Reader,
    closures: Sequence[Closure],
    model: Model,
    noise: Noise,
    notes: tuple[str, ...],
    uncompared: str,
    seed: int,
    command: str,
) -> Comparison:
    """Closures side by side on the same sums; impacts are not left out one by one.

    `uncompared` is what the verdict says of closures that cannot be compared so.
    """
    from ifrfit.inference.sufficient_statistics.stream_fit import fit_stream

    asked = [asked_of_stream(reader.stream, model.with_closure(c), c, noise, seed) for c in closures]
    found = fit_stream(
        reader,
        asked,
        noise.policy,
        Exact(),
        separate_noise=bool(model.separate),
        seed=seed,
        command=command,
    )
    fits = {c.name: each.condensed for c, each in zip(closures, found, strict=True)}
    more = {c.name: each.correction.of_evidence for c, each in zip(closures, found, strict=True)}
    beyond = optima_beyond_priors(fits)
    priors = tuple(
        replace(
            row, log_evidence={n: None if x is None else x + more[n] for n, x in row.log_evidence.items()}
        )
        for row in prior_table(fits, beyond)
    )
    if not fits[closures[0].name].problem_and_optimum()[0].has_oblique:
        notes += (_NO_OBLIQUE,)
    notes += tuple(words_beside_criteria(name, each) for name, each in beyond.items())
    notes += ("Cross-validation and the psi plane take the rows one by one, which were not held in memory.",)
    evidence = {name: fit.fit.log_evidence or 0.0 for name, fit in fits.items()}
    entries = _entries(fits, evidence, {})
    verdict = verdict_of(entries, priors)
    verdict = replace(verdict, says=f"{verdict.says} {uncompared}".rstrip())
    shown = {
        c.name: replace(entries[c.name], fit=each.result) for c, each in zip(closures, found, strict=True)
    }
    plane = PsiPlane("the rows were not held in memory")
    return Comparison(shown, priors, plane, with_reservations(verdict, shown), notes)


def compare_result(result: FitResult) -> Comparison:
    """Weigh all closures by the impacts, constants and noise of a fit, each to a tolerance of 1e-2.

    A fit by exact posterior stands for its own closure. Those of the others are brief: outliers, remedies,
    effects, sharing and what the data determine of each constant are not looked for, impacts not left out,
    and optima over unknown noises not proven where that takes long.

    Parameters
    ----------
    result : FitResult
        Of a fit, or read from a file. What it fixed or knew of a constant holds for every closure that has
        this constant.

    Returns
    -------
    Comparison

    Raises
    ------
    UsageError, DataError
        If the result does not keep its question, or a closure cannot be fitted.
    """
    problem, _ = question_of(result)
    if problem.parameters.is_tied:
        raise UsageError("Constants are tied, which other closures do not have in the same sense.")
    closures, notes = known_to(problem.error_model.is_plain)
    fits = {closure.name: _fitted(closure, problem, result) for closure in closures}
    brief = {name for name, fit in fits.items() if fit is not result}
    return _weighed(fits, notes, loo=False, seed=result.seed, brief=brief)


def _fitted(closure: Closure, problem: Problem, result: FitResult) -> FitResult:
    if closure.name == result.closure and isinstance(result.distribution, ExactPosterior):
        return result
    try:
        other = problem.with_closure(closure)
        reason = Exact().refuses(other)
        if reason:
            raise UsageError(reason)
        optimum = least_squares(other, proven=False)
        posterior = exact_posterior(other, _TOLERANCE, optimum, seed=result.seed)
        estimation = posterior_estimation(other, optimum, posterior, None)
        return build_result(
            other, optimum, estimation, seed=result.seed, command=result.command, compared=True
        )
    except (UsageError, DataError) as error:
        raise type(error)(f"Closure {closure.title}: {error.in_shell}") from None


def _weighed(
    fits: dict[str, FitResult],
    notes: tuple[str, ...],
    loo: bool,
    seed: int,
    tell: Callable[[int], None] = lambda done: None,
    brief: Collection[str] = (),
) -> Comparison:
    """Put fits by exact posterior, one a closure, side by side; arguments as `compare`, some fits `brief`."""
    beyond = optima_beyond_priors(fits)
    priors = prior_table(fits, beyond)
    evidence = {name: float(posterior_of(fit).log_evidence) for name, fit in fits.items()}
    problems = [fit.problem_and_optimum()[0] for fit in fits.values()]
    if loo and problems[0].common is not None:
        loo = False
        notes += ("Rows have errors in common, which tie impacts to one another: none is left out by turns.",)
    found, without = _cross_validated(fits, evidence, seed, tell) if loo else ({}, ())
    notes += (*without, *(words_beside_criteria(name, each) for name, each in beyond.items()))
    if not problems[0].has_oblique:
        notes += (_NO_OBLIQUE,)
    entries = _entries(fits, evidence, found)
    plane = psi_plane(problems)
    verdict = with_reservations(verdict_of(entries, priors), entries, brief)
    return Comparison(entries, priors, plane, verdict, notes)


def _cross_validated(
    fits: dict[str, FitResult], evidence: Mapping[str, float], seed: int, tell: Callable[[int], None]
) -> tuple[dict[str, Loo], tuple[str, ...]]:
    """Every closure with draws of its own, whichever others are compared; and why some have no number.

    Impacts are left out in earnest under those alone that have a hope beside the best.
    """
    found, without = {}, []
    for name, fit in fits.items():
        has_hope = evidence[name] >= max(evidence.values()) - HOPELESS
        own = loo_of(fit, np.random.SeedSequence([seed, *name.encode()]), in_earnest=has_hope)
        if own is None:
            return {}, (_TOO_MANY,)
        if math.isfinite(own.elpd):
            found[name] = own
        else:
            pairs = zip(own.impacts, own.pointwise, strict=True)
            without.append(
                f"Cross-validation of {get_closure(name).title} gives no number: by its draws "
                f"{_some([impact for impact, x in pairs if not math.isfinite(x)])} has no probability that "
                "could be told. Its evidence stands; the other closures keep their numbers."
            )
        tell(len(found) + len(without))
    return with_differences(found), tuple(without)


def _some(impacts: Sequence[str]) -> str:
    """The first of some impacts, and how many there are."""
    return impacts[0] + (f" (and {len(impacts) - 1} more)" if len(impacts) > 1 else "")


def _entries(
    fits: dict[str, FitResult], evidence: Mapping[str, float], loo: dict[str, Loo]
) -> dict[str, Entry]:
    chance = probabilities(evidence)
    top = max(evidence.values())
    found = {}
    for name, fit in fits.items():
        problem, _ = fit.problem_and_optimum()
        free, prior, gap = int(problem.parameters.free.sum()), prior_of(problem), evidence[name] - top
        found[name] = Entry(fit, free, aicc(fit), gap, chance[name], prior, loo.get(name))
    return found


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
    several = isinstance(names, Iterable) and not isinstance(names, str)
    named = tuple(names) if several else names or ()  # type: ignore[arg-type]
    check_form("--closures", "names", named)
    given = [named] if isinstance(named, str) else list(named)
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
    question: Question,
    closures: Sequence[Closure],
    model: Model,
    seed: int,
    command: str,
    found: dict[str, FitResult],
    tell: Callable[[int], None],
) -> None:
    """Fit every closure by exact posterior, and put each into `found`.

    Raises
    ------
    UsageError, DataError
        As `ifrfit.fit`; with the name of the closure where another one may well pass.
    """
    own = {c.constant for c in closures if c.constant}
    specific = any(name in own for named in model.named_constants().values() for name in named)
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
            named = error.in_shell.startswith(f"Closure {closure.title} ")
            raise type(error)(
                error.in_shell if named else f"Closure {closure.title}: {error.in_shell}"
            ) from None
        tell(len(found))


def aicc(result: FitResult) -> float | None:
    """AIC corrected for few rows; None where that form is not defined.

    The correction 2 k (k + 1)/(n - k - 1) is derived for linear models with one unknown noise scale, which k
    counts; with known noise AIC itself is exact there, and with several scales, or one beside known
    noise, there is no such form.

    References
    ----------
    Hurvich & Tsai (1989), Biometrika 76, 297.
    """
    n = result.fit.n
    one_scale = result.noise.policy not in ("known", "mixed") and len(result.noise.estimates) == 1
    k = result.fit.rank + 1
    if not one_scale or n - k - 1 <= 0:
        return None
    return result.fit.aic + 2.0 * k * (k + 1) / (n - k - 1)


def probabilities(log_evidence: Mapping[str, float]) -> dict[str, float]:
    """Posterior probability of each closure, all equally probable before."""
    return dict(zip(log_evidence, special.softmax(list(log_evidence.values())).tolist(), strict=True))
