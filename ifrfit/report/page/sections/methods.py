"""A paragraph of methods as a paper has it, made of what was done, and what to cite for it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ifrfit.inference.estimators import title_of
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closures import CLOSURES
from ifrfit.physics.inertia import BODIES
from ifrfit.report.page.blocks import Block, Code, Download, Paragraph
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.references import bibtex
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.provenance import kinds_of, left_out, provenance_words, stand_in_words
from ifrfit.report.regimes import count_impacts, has_angle
from ifrfit.report.sentences import by_series, closure_title, value_text
from ifrfit.text import joined

BIBTEX = "references.bib"
_METHODS = {
    "exact": "the posterior distribution, integrated numerically",
    "lsq": "least squares",
    "profile": "profile likelihood about the least-squares optimum",
    "mcmc": "Markov chain Monte Carlo",
}


def build(given: ReportInput) -> Sequence[Block]:
    """The paragraph, the closure's sources, and BibTeX."""
    result = given.result
    references = bibtex(result)
    blocks: list[Block] = [Paragraph(methods_text(result))]
    closure = CLOSURES.get(result.closure)
    if closure is not None:
        blocks.append(Paragraph(f"Closure {closure.title}: {closure.source.rstrip('.')}."))
    return (
        *blocks,
        Code("To cite the model, the data and the software:", references.rstrip(), is_command=False),
        Download(BIBTEX, "text/plain", references, "The same as a file."),
    )


def methods_text(result: FitResult) -> str:
    """What was done, in sentences to paste: data, model, noise, choices, method, software."""
    sentences = [
        *_data(result),
        _model(result),
        _noise(result),
        *_choices(result),
        _method(result),
        _estimates(result),
    ]
    return " ".join(sentence for sentence in sentences if sentence)


def _data(result: FitResult) -> list[str]:
    """What was fitted, of which provenance, and what was left out."""
    points = result.points
    sources = joined([f"{s.name} ({provenance_words(kinds_of(result, s))})" for s in result.inputs])
    observables = [str(name) for name in points["observable"].unique()] if len(points) else []
    if not observables or result.is_sampled:
        amount = f"{result.fit.n:,} rows"
    elif any(has_angle(name) for name in observables):
        count = count_impacts(points)
        amount = f"{count} impact{'' if count == 1 else 's'}"
    else:
        amount = f"{len(points)} value{'' if len(points) == 1 else 's'}"
    of = f" of {joined(observables)}" if observables else ""
    first = (
        f"{stand_in_words(result)}The data are {amount}{of} from {sources or 'a source that is not named'}."
    )
    return [first, *(words for source in result.inputs if (words := left_out(source)))]


def _model(result: FitResult) -> str:
    closure = CLOSURES.get(result.closure)
    named = f" ({closure.full_title})" if closure is not None and closure.full_title else ""
    body = next((name for j, name in BODIES.items() if math.isclose(j, result.inertia_factor)), "")
    inertia = f"{result.inertia_factor:.6g}{f' ({body})' if body else ''}"
    return f"The model is closure {closure_title(result)}{named} with inertia factor {inertia}."


def _noise(result: FitResult) -> str:
    """What was taken for the size of errors, and their law."""
    noise = result.noise
    own = ", for each series by itself" if noise.separate else ""
    words = {
        "known": "Standard uncertainties of the values were taken as the data give them",
        "scaled": "Standard uncertainties were those of the data times a factor that was estimated, too",
        "unknown": f"The noise of each observable was estimated with the constants{own}",
        "mixed": (
            f"Standard uncertainties of {noise.whose(given=True)} were taken as the data give them, the "
            f"noise of {noise.whose(given=False)} was estimated with the constants{own}"
        ),
    }.get(noise.policy, f"Noise: {noise.policy}")
    law = noise.error_model.words
    return f"{words}; {law}." if law else f"{words}, with independent Gaussian errors."


def _choices(result: FitResult) -> list[str]:
    """What was fixed, what was known before, and between which bounds the rest lay."""
    found = []
    fixed = [
        f"{name} = {value_text(estimate)}"
        for name, estimate in result.flat_constants().items()
        if estimate.status == "fixed"
    ]
    if fixed:
        found.append(f"Fixed: {joined(fixed)}.")
    separate = [each.name for each in result.asked if each.separate and each.fixed is None]
    if separate and any(len(by_series(result.constants.get(name))) > 1 for name in separate):
        found.append(f"Each series has its own {joined(separate)}.")
    tied = [f"{name} = {text}" for each in result.asked for name, text in each.ties]
    if tied:
        found.append(f"Tied: {joined(tied)}.")
    known = result.is_posterior
    whole = [each for each in result.asked if each.fixed is None and each.name not in dict(each.ties)]
    free = [_free_words(each, is_posterior=known) for each in whole]
    if free:
        found.append(f"{'Priors' if known else 'Bounds'}: {'; '.join(free)}.")
    return found


def _free_words(each: Parameter, *, is_posterior: bool) -> str:
    """The prior of a free constant, or the bounds between which it was looked for."""
    upper = each.prior_upper if is_posterior else each.upper
    end = f"{upper:.6g}" if math.isfinite(upper) else "no end"
    between = f"{each.lower:.6g} to {end}"
    if each.shape is not None:
        return f"{each.name} {each.shape.words}, cut to {between}"
    if each.prior is not None:
        mean, sd = each.prior
        return f"{each.name} normal with mean {mean:.6g} and standard deviation {sd:.6g}, cut to {between}"
    return f"{each.name} uniform from {between}" if is_posterior else f"{each.name} from {between}"


def _method(result: FitResult) -> str:
    version = result.versions.get("ifrfit", "")
    title = title_of(result.method)
    how = _METHODS.get(result.method, title[:1].lower() + title[1:])
    converged = result.facts.get("converged")
    figures = converged.figures if converged is not None else {}
    if {"scheme", "replicates"} <= figures.keys():
        how = f"a {figures['scheme']} bootstrap of {figures['replicates']:,} replicates"
    return (
        f"Constants were estimated by {how}, with ifrfit{f' {version}' if version else ''} "
        f"(seed {result.seed})."
    )


def _estimates(result: FitResult) -> str:
    """What the numbers of the table are."""
    value = "medians" if result.is_posterior else "the best values"
    kind = "credible" if result.is_posterior else "confidence"
    return f"Given are {value} with standard deviations and {kind} intervals of 95 %."


SECTION = ReportSection("methods", "Methods, and what to cite", build, frozenset({"code", "download"}))
