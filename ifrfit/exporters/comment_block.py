"""What every export says of itself: source, constants, law, mapping, residual, quantiles, draws."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit._version import __version__
from ifrfit.data.observations import Source
from ifrfit.data.schema import STAND_IN
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import IN_XML, Comments, Exporter, Translation
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.entry_names import entry_name
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate, by_entry, is_quiet
from ifrfit.option_words import in_python
from ifrfit.physics.angles import Incidence
from ifrfit.text import joined

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
WIDTH = 96
_NOISE = {
    "known": "sigma as given",
    "scaled": "given sigma, scaled to the scatter",
    "unknown": "sigma estimated from the scatter",
    "mixed": "sigma as given, and estimated where it is not",
}
MARK = "Exported by ifrfit"  # in the first lines of every export: what may be replaced


def comment_block(
    result: FitResult,
    constants: ExportedConstants,
    target: Exporter,
    translation: Translation,
    *,
    named: Mapping[str, float],
    series: str | None,
) -> list[str]:
    """Lines of the block, without the target's comment signs."""
    paragraphs = [
        f"{MARK} {__version__} for {target.title}.",
        _run_words(target, translation),
        *_source(result),
        *_range(result),
        *_doubts(result),
        f"Closure {constants.closure.title}, inertia factor J = {constants.inertia_factor:g}, method "
        f"{result.method}; {_NOISE.get(result.noise.policy, result.noise.policy)}.",
        *_constants(result, constants, named, series),
        f"Law of the target: {translation.law}",
        *(f"Mapping: {words}" for words in translation.mapping),
        f"Holds: {translation.holds}",
        residual_words(constants, translation),
        *_quantiles(result, constants, named, series),
    ]
    lines: list[str] = []
    for paragraph in paragraphs:
        indent = "  " if paragraph.startswith("  ") else ""
        paragraph = indent + " ".join(paragraph.split())  # no line feed of a name or a command stays
        lines += textwrap.wrap(
            paragraph, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
        )
    return lines


def _run_words(target: Exporter, translation: Translation) -> str:
    if translation.response is None:
        return "Nothing was run: the file holds constants."
    if translation.ran:
        return f"Run here: {translation.ran}."
    if translation.how == "evaluated":
        return "The text was not run; its law was evaluated by ifrfit."
    return f"{target.title} was not run here; its documented law was {translation.how} by ifrfit."


def _source(result: FitResult) -> list[str]:
    words = []
    if any(STAND_IN in source.provenance for source in result.inputs):
        words.append(
            "STAND-IN data: generated from constants that a paper prints, no experiment. These constants "
            "show that the tool works, not what real spheres do."
        )
    for source in result.inputs:
        selection = f", selection: {source.selection}" if source.selection else ""
        words.append(
            f"Data: {source.name}, {source.rows_used} rows, provenance {_provenance(result, source)}"
            f"{selection}{_fingerprint(source)}."
        )
    words.append(f"Fit: {result.command or 'in Python'} ({result.created}).")
    if result.assumed:
        words.append(f"Assumed: {'; '.join(result.assumed)}.")
    words += [f"Warning of the fit: {text}" for text in result.warnings]
    return words


def _provenance(result: FitResult, source: Source) -> str:
    """Of the rows used; of all rows of the source where not all of the used ones are kept."""
    points = result.points
    if points.empty or result.is_sampled:
        return source.provenance or "not given"
    own = points.loc[points["source"] == source.name, "provenance"].fillna("")
    return joined([name for name in own.unique() if name]) or source.provenance or "not given"


def _fingerprint(source: Source) -> str:
    """None of a folder that was read some rows at a time."""
    return f", SHA-256 {source.sha256[:16]}" if source.sha256 else ""


def _range(result: FitResult) -> list[str]:
    """Angles, speeds and spins of the rows that the constants rest on."""
    points = result.points
    if points.empty:
        return ["Range of the data: not kept with the result."]
    angles = points["gamma_deg"].dropna()
    if angles.empty:
        return ["Range of the data: no oblique impact; single values without an angle."]
    speeds = points["speed_m_s"].dropna()
    spins = points[["spin_x", "spin_y"]].fillna(0.0).to_numpy()
    parts = [
        _between(angles, "degrees"),
        _between(speeds, "m/s") + _unstated(len(points) - len(speeds))
        if len(speeds)
        else "speeds not stated",
        f"spins R omega/u from {spins.min():.3g} to {spins.max():.3g}"
        if np.any(spins)
        else "without spin before",
    ]
    sample = " (of a random sample of the rows)" if result.is_sampled else ""
    return [f"Range of the data{sample}: {', '.join(parts)}; beyond it the constants are extrapolated."]


def _between(values: pd.Series, unit: str) -> str:
    low, high = f"{values.min():.4g}", f"{values.max():.4g}"
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def _unstated(rows: int) -> str:
    return f" (not stated in {rows} rows)" if rows else ""


def _doubts(result: FitResult) -> list[str]:
    """Facts that do not stand, and that nothing was tested where so."""
    words = []
    for name, fact in result.facts.items():
        says = fact.says if result.command else in_python(fact.says)
        if (name == "lack_of_fit" and not fact.is_tested) or (not fact.ok and not is_quiet(name, fact)):
            words.append(f"LOOK: {says.rstrip('.')}.")
    return words


def _constants(
    result: FitResult, constants: ExportedConstants, named: Mapping[str, float], series: str | None
) -> list[str]:
    found = by_entry(result.constants)
    words = []
    for name, value in constants.values.items():
        estimate = _entry(found, name, series)
        if name in named:
            words.append(
                f"{name} = {value:.10g}: named by the user for this export, not by the data "
                f"({estimate.status} in the fit)."
            )
            continue
        sd = "" if estimate.stderr is None else f", sd {estimate.stderr:.3g}"
        low, high = estimate.interval95
        interval = "" if estimate.status == "fixed" else f", 95 % {low:.4g} to {high:.4g}"
        reason = f" ({estimate.reason})" if estimate.reason else ""
        words.append(f"{name} = {value:.10g}{sd}{interval}; {estimate.status}{reason}.")
    return words


def _entry(found: Mapping[str, Estimate], name: str, series: str | None) -> Estimate:
    return found[name] if name in found else found[entry_name(name, series or "")]


def residual_words(constants: ExportedConstants, translation: Translation) -> str:
    """The deviation of the target's law from the fitted curve, over its angles without spin."""
    if translation.response is None:
        return "Residual: none, for the file holds the constants as they are and no law."
    angles = np.asarray(translation.angles, dtype=float)
    incidence = Incidence.of(angles, degrees=True)
    fitted, found = constants.rebound(incidence), translation.response(incidence)
    parts = [
        _largest("e_n", (found.v_n - fitted.v_n) / incidence.cosine, angles),
        _largest("v_x/u", found.v_x - fitted.v_x, angles),
    ]
    if found.beta is not None:
        parts.append(_largest("beta", found.beta - fitted.beta, angles))
    else:
        parts.append("the spin is left as it was, so there is no beta")
    return (
        f"Residual of the target's law ({translation.how}) against the fitted curve, without spin, at "
        f"{angles.size} angles from {angles[0]:g} to {angles[-1]:g} degrees: {'; '.join(parts)}."
    )


def _largest(name: str, deviation: Array, angles: Array) -> str:
    at = int(np.argmax(np.abs(deviation)))
    rms = float(np.sqrt(np.mean(deviation**2)))
    if abs(deviation[at]) < 1e-12:
        return f"{name} within 1e-12"
    if abs(deviation[at]) < 1e-9:  # of a search
        return f"{name} within 1e-9"
    return f"{name} off by {deviation[at]:+.3g} at worst ({angles[at]:g} degrees), {rms:.2g} rms"


def _quantiles(
    result: FitResult, constants: ExportedConstants, named: Mapping[str, float], series: str | None
) -> list[str]:
    distribution = result.distribution
    kind = "posterior" if result.is_posterior else f"distribution of method {result.method}"
    rows = []
    for name in constants.values:
        entry = name if name in distribution.names else entry_name(name, series or "")
        if name not in named and entry in distribution.names:
            numbers = np.asarray(distribution.quantile(entry, LEVELS), dtype=float)
            rows.append(f"{name} " + " ".join(f"{x:.6g}" for x in numbers))
    if not rows:
        return []
    levels = ", ".join(f"{100 * level:g}" for level in LEVELS)
    return [f"Quantiles of the {kind} at {levels} %:", *(f"  {row}" for row in rows)]


def draws_lines(draws: Mapping[str, Array]) -> list[str]:
    """The table of draws, a line each."""
    names = list(draws)
    lines = [f"Draws, {len(draws[names[0]])} of them: {' '.join(names)}"]
    lines += ["  " + " ".join(f"{x:.10g}" for x in row) for row in np.column_stack(list(draws.values()))]
    return lines


def commented(lines: Sequence[str], target: Exporter) -> list[str]:
    """The block in the target's comment signs."""
    signs = target.comments
    body = [f"{signs.line}{_inside(line, signs)}".rstrip() for line in lines]
    return [*([signs.opening] if signs.opening else []), *body, *([signs.closing] if signs.closing else [])]


def _inside(line: str, signs: Comments) -> str:
    """A line that neither ends the comment nor is continued by the next one."""
    if signs is IN_XML:
        line = line.replace("--", "- -")  # two hyphens are not allowed in its comments
    elif signs.closing:
        for mark in (signs.opening.strip(), signs.closing.strip()):  # compilers warn of the former
            line = line.replace(mark, " ".join(mark))
    return f"{line} ." if line.endswith(("&", "\\")) else line
