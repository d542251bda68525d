"""An effect of scenes: after the contact, a brake takes a share of the normal velocity."""

from dataclasses import dataclass, replace
from typing import Literal

from ifrfit.physics.effects.contact import Contact, ContactNumber, Impacts
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Stage, Validity

# a scene gives it as [contact] brake_share = 0.5; without it the effect does nothing
BRAKE_SHARE = ContactNumber("brake_share", 0.0, 1.0)


@dataclass(frozen=True)
class Brake:
    """Takes a share of the normal velocity after the contact."""

    name: str = "brake"
    title: str = "brake"
    stage: Stage = "rolling"
    replaces: Literal[""] = ""
    cost_ns: float = 5.0
    numbers: tuple[ContactNumber, ...] = (BRAKE_SHARE,)
    source: str = "made up"

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """What the scene does not say."""
        return contact.lacks(BRAKE_SHARE, hertzian=False)

    def validity(self, contact: Contact, impacts: Impacts) -> Validity:
        """Where it holds; here everywhere."""
        return Validity()

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Its dimensionless number, and from where on it matters."""
        return Criterion("B", contact.number(BRAKE_SHARE), accuracy)

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """The impact with the effect."""
        out, kept = bounce.done, 1.0 - contact.number(BRAKE_SHARE)
        return replace(bounce, outcome=replace(out, v_n=kept * out.v_n, e_n=kept * out.e_n))
