"""What an effect must give."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

from ifrfit.physics.effects.contact import Contact, ContactNumber, Impacts
from ifrfit.physics.effects.impact_state import Bounce, Outcome

Stage = Literal["plane", "normal", "adhesion", "tangential", "rolling", "fluid"]
# the one order in which effects compose
ORDER: tuple[Stage, ...] = ("plane", "normal", "adhesion", "tangential", "rolling", "fluid")


@dataclass(frozen=True)
class Criterion:
    """The dimensionless number of an effect in a scene.

    Attributes
    ----------
    symbol : str
        As V_s/V.
    value : float
        The most critical one over the impacts.
    threshold : float
        Beyond it the effect matters, by the rule of thumb of its source.
    above : bool
        Whether beyond means above.
    """

    symbol: str
    value: float
    threshold: float
    above: bool = True

    @property
    def met(self) -> bool:
        """Whether the number is beyond the threshold."""
        return self.value > self.threshold if self.above else self.value < self.threshold


@dataclass(frozen=True)
class Validity:
    """Whether the law holds for these impacts, and what should be known about that.

    Attributes
    ----------
    holds : bool
    words : str
        Why it does not hold; where it holds, a remark or nothing.
    """

    holds: bool = True
    words: str = ""


@runtime_checkable
class Effect(Protocol):
    """One effect: one file, one line of the registry, one test file.

    A class that inherits from it has the usual answers where it gives none.
    The change of the observables is not the effect's to state: `ifrfit.physics.effects.plan` finds it by
    computing a few hundred of the scene's impacts with the effect and without it.
    """

    @property
    def name(self) -> str:
        """As in a scene's list of effects."""

    @property
    def title(self) -> str:
        """As in the plan."""

    @property
    def stage(self) -> Stage:
        """Its place in `ORDER`."""

    @property
    def replaces(self) -> Literal["", "e_n", "tangential"]:
        """Which constant it takes the place of: e_n, or the closure's own one."""
        return ""

    @property
    def numbers(self) -> tuple[ContactNumber, ...]:
        """What it needs to know of the contact beyond bodies and fluid: keys of a scene's table [contact]."""
        return ()

    @property
    def cost_ns(self) -> float:
        """Nanoseconds an impact on one core, about, see benchmarks/effects.py."""

    @property
    def source(self) -> str:
        """Where the law comes from."""

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """Say what it would need to know; empty if it can be computed."""

    def validity(self, contact: Contact, impacts: Impacts) -> Validity:
        """Whether its law holds here."""
        return Validity()

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Its dimensionless number; `outcome` is the scene with every effect that can be computed."""

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """Let it act."""
