"""Which effects beyond the closure the residuals show, and which ones the conditions call for."""

from __future__ import annotations

from collections.abc import Sequence

from ifrfit.inference.diagnostics.omitted_effects.types import EffectLine
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.effects import EFFECTS
from ifrfit.report.page.blocks import Block, Paragraph, Table
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.sentences import scene_notes, sentence
from ifrfit.text import p_text, plus_minus

# what a misfit may be instead of an effect
_RIVALS = {
    "sticking-law": "another law of sticking",
    "sliding-law": "restitution in sliding",
    "sticking-by-angle": "constant of sticking by angle",
    "restitution-by-angle": "restitution by angle",
    "friction-by-speed": "friction by speed",
    "friction-by-load": "friction by load",
    "inertia-factor": "another inertia factor",
}


def build(given: ReportInput) -> Sequence[Block] | None:
    """Tests of the residuals, and criteria on the scene; None where there is neither."""
    result = given.result
    fact = result.facts.get("effects")
    if fact is None and not result.effects:
        return None
    blocks: list[Block] = []
    if fact is not None:
        blocks += [Paragraph(sentence(fact.says), "plain" if fact.ok else "look"), _tests(result)]
    blocks += [Paragraph(sentence(says), "note") for says in scene_notes(result)]
    if result.scene is not None:
        blocks += [_scene(result), _criteria(result.effects)]
    return blocks


def _tests(result: FitResult) -> Table:
    found = result.facts["effects"].figures["tests"]
    rows = tuple(
        (
            _title(name),
            *_cells(test["strength"], test["sd"]),
            f"{test['drop']:.1f}",
            p_text(test["p"]),
        )
        for name, test in sorted(found.items(), key=lambda item: -item[1]["drop"])
    )
    return Table(
        "Score tests of the residuals along what each effect would do to the values, the most telling first. "
        "Strength: 1 is the effect as its theory has it; of adhesion the square of the sticking speed in "
        "(m/s)^2, of rolling friction mu_r, of other laws of sticking and sliding the change of the impulse "
        "factor, of restitution by angle the change of e_n over the tangent of the angle, of friction by "
        "speed d ln mu/d ln speed, of the inertia factor its relative change. p is corrected for the number "
        "of tests.",
        ("effect", "strength", "sd", "fall of -2 log L", "p"),
        rows,
        frozenset({1, 2, 3, 4}),
    )


def _cells(strength: float, sd: float) -> tuple[str, str]:
    """Both to two digits of the sd, as the words above the table have them."""
    value, _, own = plus_minus(strength, sd).partition(" +- ")
    return value, own or "-"


def _title(name: str) -> str:
    return EFFECTS[name].title if name in EFFECTS else _RIVALS.get(name, name)


def _scene(result: FitResult) -> Paragraph:
    scene = result.scene
    assert scene is not None
    known = "; ".join(scene.known) or "nothing"
    unknown = f" Not known: {'; '.join(scene.unknown)}." if scene.unknown else ""
    return Paragraph(f"Scene from {scene.origin}. Known: {known}.{unknown}")


def _criteria(lines: tuple[EffectLine, ...]) -> Table:
    rows = tuple(
        (_title(line.effect), "-" if line.met is None else "yes" if line.met else "no", line.says)
        for line in lines
    )
    return Table(
        "Criteria of the effects on this scene; changes are those that no choice of the constants could take "
        "up. What would change values by less than the noise cannot be seen in these data; what is not given "
        "can be given by --scene.",
        ("effect", "acts", "number and change"),
        rows,
    )


SECTION = ReportSection("effects", "Effects beyond the closure", build, frozenset({"table"}))
