"""Effects beyond constant coefficients, each computed only where a scene calls for it."""

from ifrfit.physics.effects.contact import Contact, Fluid, Impacts
from ifrfit.physics.effects.impact_state import Outcome
from ifrfit.physics.effects.plan import Plan, PlanLine, compose, make_plan
from ifrfit.physics.effects.protocol import ORDER, Criterion, Effect, Validity
from ifrfit.physics.effects.registry import EFFECTS, plane_effects

__all__ = [
    "EFFECTS",
    "ORDER",
    "Contact",
    "Criterion",
    "Effect",
    "Fluid",
    "Impacts",
    "Outcome",
    "Plan",
    "PlanLine",
    "Validity",
    "compose",
    "make_plan",
    "plane_effects",
]
