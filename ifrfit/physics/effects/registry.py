"""All effects, in the order in which they compose. A further effect is one more entry."""

from __future__ import annotations

from ifrfit.physics.effects.adhesion import Adhesion
from ifrfit.physics.effects.compliance import Compliance
from ifrfit.physics.effects.fluid import AmbientFluid
from ifrfit.physics.effects.lateral import LateralSpin
from ifrfit.physics.effects.plasticity import Plasticity
from ifrfit.physics.effects.protocol import ORDER, Effect
from ifrfit.physics.effects.rolling import Rolling
from ifrfit.physics.effects.viscoelastic import Viscoelastic

_ALL: tuple[Effect, ...] = (
    LateralSpin(),
    Viscoelastic(),
    Plasticity(),
    Adhesion(),
    Compliance(),
    Rolling(),
    AmbientFluid(),
)
EFFECTS: dict[str, Effect] = {
    effect.name: effect for effect in sorted(_ALL, key=lambda effect: ORDER.index(effect.stage))
}
