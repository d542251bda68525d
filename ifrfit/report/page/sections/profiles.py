"""Profile likelihoods."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.profile.types import ProfileLikelihood
from ifrfit.physics.closures import CLOSURES
from ifrfit.report.axis_words import symbol
from ifrfit.report.page.blocks import Block, Paragraph, Picture, Pictures
from ifrfit.report.page.charts.chart import Axis, Box, Chart, Line, Mark, Points, Words, one_panel
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.style import COLOURS, GREY, RESIDUAL_DASHES

MOST = 8
SHAPES = {
    "bounded": "closes on both sides",
    "one_sided": "stays open on one side",
    "flat": "stays open on both sides",
    "multimodal": "has several minima",
}
WIDTH_MM, HEIGHT_MM = 62.0, 48.0
LONGEST = 14  # characters of a series' name


def build(given: ReportInput) -> Sequence[Block]:
    """Profiles of the constants, of kappa and of the transition angles."""
    profiles = given.appraisal.profiles
    if not profiles:
        return (Paragraph(given.appraisal.without_profiles, "note"),)
    names = [name for name in profiles if profiles[name].x.size > 1 and _is_informative(given, name)]
    pictures = tuple(
        Picture(
            f"profile-{number}",
            f"Profile of {name}",
            f"The profile {SHAPES[profiles[name].shape]}; least at {profiles[name].value:.5g}, 95 % between "
            f"{profiles[name].central95[0]:.5g} and {profiles[name].central95[1]:.5g}.",
            draw_profile(profiles[name]),
        )
        for number, name in enumerate(names[:MOST], 1)
    )
    left_out = f" Not shown: {', '.join(names[MOST:])}." if len(names) > MOST else ""
    rise = (
        "Least rise of chi2"
        if given.result.noise.policy == "known"
        else "Least rise of the misfit, noise profiled out,"
    )
    caption = (
        f"{rise} with one quantity held and everything else at its best. Dashed: the cuts of a 68 and a 95 % "
        f"interval; shaded: the values below them; dot: the optimum.{left_out}"
    )
    return (Pictures(pictures, caption),)


def _is_informative(given: ReportInput, name: str) -> bool:
    """Whether a profile is more than that of a constant on a stretched axis.

    The restitution in sticking runs with the closure's constant, kappa with mu where e_n is fixed.
    """
    kind = quantity_of(name)
    if kind == "kappa":
        return any(quantity_of(label) == "e_n" for label in given.free)
    closure = CLOSURES.get(given.result.closure)
    meaning = None if closure is None else closure.meaning
    return meaning is None or kind != meaning.name or not meaning.linear


def draw_profile(profile: ProfileLikelihood) -> Chart:
    """Rise of the objective against the quantity, with the cuts of 68 and 95 %."""
    cuts = {level: profile.cut(level) for level in (0.68, 0.95)}
    top = 2.1 * cuts[0.95]
    finite = np.isfinite(profile.x)
    known = profile.x[finite]
    low, high = _window(known, known[profile.rise[finite] <= top])
    marks: list[Mark] = []
    for level, pieces, opacity in ((0.95, profile.pieces, 0.14), (0.68, profile.pieces68, 0.22)):
        for piece in pieces:  # one without end is shaded as far as the profile is known
            left, right = np.clip(piece, known.min(), known.max()).tolist()
            marks.append(Box((left, right), (-math.inf, math.inf), COLOURS[0], opacity))
        cut = cuts[level]
        marks += [
            Line(np.array([low, high]), np.full(2, cut), GREY, 0.7, RESIDUAL_DASHES),
            Words(0.5 * (low + high), cut + 0.02 * top, f"{100 * level:.0f} %", colour=GREY, height="bottom"),
        ]
    shown = finite & (profile.rise <= 1.5 * top)
    optimum = np.array([profile.value]), np.zeros(1)
    marks += [
        Line(profile.x[shown], profile.rise[shown], COLOURS[0], 1.3),
        Points(*optimum, "o", 4.5, COLOURS[0], COLOURS[0], is_clipped=False),
    ]
    x = Axis(low, high, symbol(profile.name, LONGEST), most=5)
    return one_panel(x, Axis(0.0, top, "rise"), marks, WIDTH_MM, HEIGHT_MM, left=11.0)


def _window(known: np.ndarray, below: np.ndarray) -> tuple[float, float]:
    """What is in sight: where the profile stays low, or all that is known of it."""
    for x in (below, known):
        if x.size > 1 and x.max() > x.min():
            return float(x.min()), float(x.max())
    room = 0.1 * max(abs(float(known[0])), 1e-3)
    return float(known[0]) - room, float(known[0]) + room


SECTION = ReportSection("profiles", "Profile likelihoods", build)
