"""What the symbols mean, for readers who have not seen them before: a drawing, and each with its formula."""

from __future__ import annotations

from collections.abc import Sequence

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closure import Closure, ClosureConstant, rotational_share
from ifrfit.physics.closures import CLOSURES
from ifrfit.report.page.blocks import Block, Definition, Definitions, Paragraph, Picture, Pictures
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.page.sections.impact_drawing import draw_impact
from ifrfit.report.sentences import sentence

DESCRIPTION = (
    "A sphere touches a wall. It comes in with velocity u at the angle gamma from the normal of the wall and "
    "leaves with velocity v. It spins with omega about its centre. The contact point moves along the wall "
    "with U_t before the impact and V_t after it."
)
_STATUSES = (
    "Determined: the data fix it. One-sided: they bound it on one side. Prior: it rests on what was put in. "
    "Not determined: they leave it open, whatever number a program may print."
)


def build(given: ReportInput) -> Sequence[Block]:
    """Definitions of what was measured and fitted, how to read the table, and the drawing."""
    result = given.result
    return (
        Definitions(tuple(_definitions(result))),
        Paragraph(_reading(result)),
        Pictures(
            (Picture("impact", "An impact", DESCRIPTION, draw_impact()),),
            "Blue: before; orange: after; green: spin. Angles count from the normal, and a spin is positive "
            "where it drives the contact point ahead (back-spin).",
        ),
    )


def _reading(result: FitResult) -> str:
    """How the table of constants is to be read."""
    if result.is_posterior:
        how = (
            "Values are medians of the posterior; given the model and the priors, a constant lies inside its "
            "95 % interval with a probability of 95 %."
        )
    else:
        how = (
            "Values are those of the best fit; intervals of 95 % would hold the true constant in 95 of 100 "
            "repetitions of the experiment, were the model right."
        )
    return f"{how} {_STATUSES}"


def _definitions(result: FitResult) -> list[Definition]:
    """Kinematics, the constants, and the closure."""
    closure = CLOSURES.get(result.closure)
    found = [
        Definition(r"\gamma", "angle of incidence, from the normal of the wall", r"\tan\gamma = u_t/u_n"),
        Definition("U_t", "velocity of the contact point along the wall", r"U_t = u_t + R\omega"),
        Definition("e_n", "normal restitution: how much of the normal velocity comes back", "e_n = v_n/u_n"),
        Definition(
            r"\beta",
            "restitution of the contact point: 1 where its velocity turns round, 0 where it stops, -1 where "
            "nothing acts on it",
            r"\beta = -V_t/U_t",
        ),
        Definition(
            r"\mu", "friction: the largest impulse of friction over the normal impulse", r"P_f \leq \mu P_n"
        ),
        Definition(r"\kappa", "what the tangential motion sees of friction", r"\kappa = \mu (1 + e_n)"),
    ]
    if closure is None:
        return found
    if closure.own is not None:
        words = _own_words(closure, closure.own, result)
        found.append(Definition(closure.own.latex, words, _in_sticking(closure, result.inertia_factor)))
    return [*found, closure_definition(closure, result.inertia_factor)]


def _own_words(closure: Closure, own: ClosureConstant, result: FitResult) -> str:
    low, high = closure.domain(result.inertia_factor)
    return f"{own.help}, {low:.4g} to {high:.4g}: the constant of closure {closure.title}"


def _in_sticking(closure: Closure, inertia_factor: float) -> str:
    """Restitution of the contact point in sticking as a line in the closure's constant; empty without one."""
    if not closure.bilinear or closure.own is None:
        return ""
    law, share = closure.coefficients(inertia_factor), rotational_share(inertia_factor)
    line = linear_latex((law.a0 + law.b0) / share - 1.0, (law.a1 + law.b1) / share, closure.own.latex)
    return rf"\beta = {line}\,\text{{in {closure.regimes[0]}}}"


def closure_definition(closure: Closure, inertia_factor: float) -> Definition:
    """The law of the tangential impulse, with its numbers at this inertia factor where it is bilinear."""
    named = f" ({closure.full_title})" if closure.full_title else ""
    words = (
        f"closure {closure.title}{named}: the impulse along the wall, per mass, is k times U_t, against it."
    )
    if not closure.bilinear:
        return Definition("k", f"{words} {sentence(closure.source)}")
    law = closure.coefficients(inertia_factor)
    constant = "" if closure.own is None else closure.own.latex
    a, b = (linear_latex(*pair, constant) for pair in ((law.a0, law.a1), (law.b0, law.b1)))
    stick, slide = closure.regimes
    words += f" An impact is {stick} where the first of the two under min is smaller, else {slide}."
    least = rf"\min({b}, \kappa U_n/|U_t|)"
    return Definition("k", words, f"k = {least}" if a == "0" else f"k = {a} + {least}")


def linear_latex(constant: float, slope: float, name: str) -> str:
    """A constant plus a slope times a symbol, in LaTeX, with four digits."""
    constant, slope = float(f"{constant:.4g}"), float(f"{slope:.4g}")
    if slope == 0.0:
        return f"{constant:.4g}"
    if constant == slope != 1.0:
        return f"{constant:.4g} (1 + {name})"
    term = name if abs(slope) == 1.0 else f"{abs(slope):.4g} {name}"
    if abs(constant) < 1e-12:
        return term if slope > 0.0 else f"-{term}"
    return f"{constant:.4g} {'+' if slope > 0.0 else '-'} {term}"


SECTION = ReportSection("guide", "What the symbols mean", build, frozenset({"pictures"}))
