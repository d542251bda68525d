"""Profile likelihoods."""

from __future__ import annotations

from collections.abc import Sequence

from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.physics.closures import CLOSURES
from ifrfit.report.page.blocks import Block, Paragraph, Picture, Pictures
from ifrfit.report.page.drawings.profiles import draw_profile
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput

MOST = 8
SHAPES = {
    "bounded": "closes on both sides",
    "one_sided": "stays open on one side",
    "flat": "stays open on both sides",
    "multimodal": "has several minima",
}


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


SECTION = ReportSection("profiles", "Profile likelihoods", build)
