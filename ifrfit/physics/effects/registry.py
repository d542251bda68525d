"""All effects, in the order in which they compose. A further effect is one more entry."""

from __future__ import annotations

from ifrfit.errors import UsageError
from ifrfit.physics.effects.adhesion import Adhesion
from ifrfit.physics.effects.compliance import Compliance
from ifrfit.physics.effects.fluid import AmbientFluid
from ifrfit.physics.effects.lateral import LateralSpin
from ifrfit.physics.effects.plasticity import Plasticity
from ifrfit.physics.effects.protocol import ORDER, Effect
from ifrfit.physics.effects.rolling import Rolling
from ifrfit.physics.effects.viscoelastic import Viscoelastic
from ifrfit.physics.units import dimension_of
from ifrfit.registry import Registry


def check_effect(effect: Effect) -> None:
    """Refuse an effect that has no place in the order, or whose numbers no scene could give.

    Raises
    ------
    UsageError
        For an unknown stage, for a number with an unknown unit, and for one whose name another effect has
        given another range or unit.
    """
    if effect.stage not in ORDER:
        raise UsageError(f"Effect {effect.name} has the stage '{effect.stage}': take {', '.join(ORDER)}.")
    for number in effect.numbers:
        dimension_of(number.unit)
        for other in EFFECTS.values():
            if any(each.name == number.name and each != number for each in other.numbers):
                raise UsageError(
                    f"Effect {effect.name} takes contact.{number.name}, which effect {other.name} describes "
                    "otherwise: take its number, or another name."
                )


EFFECTS: Registry[Effect] = Registry(
    "effect",
    Effect,
    (
        LateralSpin(),
        Viscoelastic(),
        Plasticity(),
        Adhesion(),
        Compliance(),
        Rolling(),
        AmbientFluid(),
    ),
    check=check_effect,
    order=lambda effect: ORDER.index(effect.stage),
)


def plane_effects() -> tuple[str, ...]:
    """Names of the effects that take impacts out of the plane of incidence: no choice of accuracy."""
    return tuple(name for name, effect in EFFECTS.items() if effect.stage == "plane")
