"""Reports of results: verdict and sections in order, and files that appear whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ifrfit.errors import UsageError
from ifrfit.inference.appraisal import Appraisal
from ifrfit.inference.diagnostics.headlines import HEADLINES
from ifrfit.inference.estimators import title_of
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate, is_quiet
from ifrfit.report.atomic_folder import Contents, deliver
from ifrfit.report.page.blocks import Badge, Report, Section
from ifrfit.report.page.html import render
from ifrfit.report.page.plugins import GENERATOR
from ifrfit.report.page.registries import FORMATS, SECTIONS
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.provenance import STAND_IN, is_stand_in, kinds_of, provenance_words
from ifrfit.report.regimes import count_impacts, has_angle
from ifrfit.report.sentences import (
    closure_title,
    headline,
    plus_minus,
    span_text,
    undetermined,
    value_text,
)
from ifrfit.text import joined

MOST_NAMED = 6
VERBS = {
    "found": "give",
    "prior": "give, with your prior,",
    "limit": "only bound",
    "open": "do not determine",
}
CHECKED = ("lack_of_fit", "outliers", "predictive")
Files = Mapping[str, bytes]


def badges(result: FitResult) -> tuple[Badge, ...]:
    """Provenance, closure, method; and whether anything needs attention."""
    kinds = dict.fromkeys(kind for source in result.inputs for kind in kinds_of(result, source))
    tones = [
        Badge(
            "STAND-IN, not an experiment" if kind == STAND_IN else provenance_words((kind,)),
            "stand-in" if kind == STAND_IN else "plain",
        )
        for kind in kinds
    ]
    found = [*tones, Badge(f"closure {closure_title(result)}"), Badge(title_of(result.method))]
    if headline(result):
        found.append(Badge("needs attention", "look"))
    return tuple(found)


def verdict(result: FitResult) -> tuple[str, str]:
    """Two sentences: what was determined and how well, and what contradicts it."""
    return _determined(result), _contradicted(result)


def _determined(result: FitResult) -> str:
    groups: dict[str, list[str]] = {}
    for name, estimate in result.flat_constants().items():
        groups.setdefault(_group(estimate), []).append(_estimate_words(name, estimate))
    clauses = [
        f"{verb} {joined(_shortened(groups[group]))}" for group, verb in VERBS.items() if group in groups
    ]
    fixed = f"{joined(_shortened(groups['fixed']))} was given to the fit" if "fixed" in groups else ""
    if len(groups.get("fixed", ())) > 1:
        fixed = fixed.replace(" was ", " were ")
    words = "; they ".join(clauses) or "leave nothing to find"
    main_clause = f"{_amount(result)} {words}"
    sentence = f"{main_clause}; {fixed}." if fixed else f"{main_clause}."
    if is_stand_in(result):
        what = sentence[:1].lower() + sentence[1:]
        return f"A fit to generated data, which shows that the tool works and is no finding: {what}"
    return sentence


def _group(estimate: Estimate) -> str:
    if estimate.status == "fixed":
        return "fixed"
    if estimate.value is None:
        return "limit" if estimate.status == "one_sided" else "open"
    return "prior" if estimate.status == "prior" else "found"


def _estimate_words(name: str, estimate: Estimate) -> str:
    label = name.replace("[", " [")
    span = span_text(estimate)
    if estimate.status == "fixed":
        return f"{label} = {value_text(estimate)}"
    if estimate.value is None:
        if span == "any value":
            return label
        return f"{label} {span} (95 %)" if span[0] in "<>" else f"{label} (95 % in {span})"
    side = f" (one-sided, 95 % in {span})" if estimate.status == "one_sided" else ""
    return f"{label} = {plus_minus(estimate)}{side}"


def _shortened(words: list[str]) -> list[str]:
    if len(words) <= MOST_NAMED:
        return words
    return [*words[:MOST_NAMED], f"{len(words) - MOST_NAMED} more"]


def _amount(result: FitResult) -> str:
    """Count what the data are, as the subject of a sentence."""
    points = result.points
    if not len(points) or result.is_sampled:
        return f"{result.fit.n:,} rows"
    observables = [str(name) for name in points["observable"].unique()]
    if not any(has_angle(name) for name in observables):
        return f"{len(points)} value{'s' if len(points) != 1 else ''} of {joined(observables)}"
    count = count_impacts(points)
    return f"{count} impact{'s' if count != 1 else ''} ({joined(observables)})"


def _contradicted(result: FitResult) -> str:
    open_ones = undetermined(result)
    failing = [
        name
        for name, fact in result.facts.items()
        if not fact.ok and not is_quiet(name, fact) and not (name == "identifiable" and open_ones)
    ]
    if failing:
        words = [_failure_words(name, result) for name in failing]
        return f"Against it stands: {'; '.join(words)}."
    fine = [result.facts[name].says.rstrip(".") for name in CHECKED if name in result.facts]
    fine = [f"{says[:1].lower()}{says[1:]}" for says in fine]
    return f"Nothing found contradicts it: {'; '.join(fine)}." if fine else "Nothing was found against it."


def _failure_words(name: str, result: FitResult) -> str:
    """Where a misfit sits is told at once; the rest by name, for the findings have the sentences."""
    if name == "lack_of_fit":
        return result.facts[name].says.rstrip(".").partition(". ")[0]
    return HEADLINES.get(name, name.replace("_", " "))


def assemble(result: FitResult, appraisal: Appraisal, figure: str | None = None) -> Report:
    """Everything that the report of a result says and shows.

    Parameters
    ----------
    result : FitResult
        Of a fit, or read from a file.
    appraisal : Appraisal
        What was computed for the report.
    figure : str, optional
        The figure of the fit as svg, where it has been drawn before.
    """
    given = ReportInput(result, appraisal, figure)
    sections = tuple(
        Section(section.name, section.title, tuple(blocks), section.beside)
        for section in SECTIONS.values()
        if (blocks := section.build(given)) is not None
    )
    foot = {"ifrfit": result.versions.get("ifrfit", ""), "fitted": result.created}
    return Report(
        title(result),
        badges(result),
        verdict(result),
        bool(headline(result)),
        sections,
        {name: text for name, text in foot.items() if text},
    )


def title(result: FitResult) -> str:
    """What was fitted, and with which closure."""
    return f"{joined([source.name for source in result.inputs]) or 'No source'}: {closure_title(result)}"


def page(result: FitResult, appraisal: Appraisal, figure: str | None = None) -> str:
    """The report of a fit as one HTML page; its figure as svg, if it has been drawn before."""
    return render(assemble(result, appraisal, figure))


def report_files(result: FitResult, appraisal: Appraisal, name: str) -> Files:
    """The files of a report, by the suffix of `name`: one, or with pictures beside it."""
    stem, _, suffix = name.rpartition(".")
    return FORMATS[suffix].write(assemble(result, appraisal), stem)


def write_report(result: FitResult, appraisal: Appraisal, path: Path, *, force: bool = False) -> list[str]:
    """Write the report of a result.

    Parameters
    ----------
    result : FitResult
        Of a fit, or read from a file.
    appraisal : Appraisal
        What was computed for the report.
    path : Path
        Its suffix is the format, see `ifrfit.report.page.registries.FORMATS`.
    force : bool
        Replace files that are not reports, too.

    Returns
    -------
    list of str
        Names of the files written.

    Raises
    ------
    UsageError
        For another suffix, where something else lies there, or where nothing can be written.
    """
    check_report(path, force=force)
    put(path.parent, report_files(result, appraisal, path.name), force=force)
    return [path.name]


def check_report(path: Path, *, force: bool = False) -> None:
    """Refuse a path where no report can be written, so that nothing is computed in vain.

    Raises
    ------
    UsageError
        If its suffix is no format of reports, or where something else lies there.
    """
    check_format(path.suffix.removeprefix("."), str(path))
    check_free(path, force=force)


def check_format(name: str, where: str) -> None:
    """Refuse what is no format of reports; `where` it was asked for begins the message.

    Raises
    ------
    UsageError
    """
    if name not in FORMATS:
        remedy = "print the page from a browser for a PDF" if name == "pdf" else "choose one of them"
        raise UsageError(f"{where}: a report is {', '.join(FORMATS)}; {remedy}.")


def check_free(path: Path, *, force: bool) -> None:
    """Refuse a path where something lies that is no report of ours, unless `force`.

    Raises
    ------
    UsageError
    """
    if path.is_dir():
        raise UsageError(f"{path} is a folder. Name a file with --out.")
    if force or not path.exists() or _is_ours(path):
        return
    raise UsageError(f"{path} is not a report of ifrfit; add --force to replace it, or choose another name.")


def _is_ours(path: Path) -> bool:
    """Whether a file is an earlier report: it says so itself, at its beginning."""
    with path.open("rb") as file:
        return GENERATOR.encode() in file.read(4096)


def put(folder: Path, files: Files, *, force: bool) -> None:
    """Put the files of reports into a folder, all of them prepared before the first is in place.

    Raises
    ------
    UsageError
        If one of the names is taken by a file of others, or nothing can be written.
    """
    if folder.is_dir():
        for name in files:
            if "/" not in name:
                check_free(folder / name, force=force)

    def fill(fresh: Path) -> list[str]:
        for name, content in files.items():
            (fresh / name).parent.mkdir(exist_ok=True)
            (fresh / name).write_bytes(content)
        return [*files]

    # the first is in place last: it never refers to a picture that is not there yet
    deliver(fill, folder, Contents(next(iter(files)), (), "report", {}), force=True)
