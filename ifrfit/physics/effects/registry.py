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
from ifrfit.registry import Registry

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
    order=lambda effect: ORDER.index(effect.stage),
)
