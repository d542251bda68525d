"""An effect of scenes: after the contact, a brake takes half of the normal velocity."""

from dataclasses import dataclass, replace
from typing import Literal

from ifrfit.physics.effects.contact import Contact, Impacts
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Stage, Validity


@dataclass(frozen=True)
class Brake:
    """Takes half of the normal velocity after the contact."""

    name: str = "brake"
    title: str = "brake"
    stage: Stage = "rolling"
    replaces: Literal[""] = ""
    cost_ns: float = 5.0
    source: str = "made up"

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """What the scene does not say; here nothing is needed."""
        return ""

    def validity(self, contact: Contact, impacts: Impacts) -> Validity:
        """Where it holds; here everywhere."""
        return Validity()

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Its dimensionless number, and by how much it would change an observable."""
        return Criterion("B", 1.0, 0.5)

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """The impact with the effect."""
        out = bounce.done
        return replace(bounce, outcome=replace(out, v_n=0.5 * out.v_n, e_n=0.5 * out.e_n))
