"""A toy of each kind that can be registered: what a user, or a package, would write."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from ifrfit.inference.estimators import LeastSquares
from ifrfit.inference.option_fields import Options, option
from ifrfit.inference.result.estimation import Estimation
from ifrfit.physics.closures import Closure, ClosureConstant, Coefficients, rotational_share
from ifrfit.physics.effects.contact import Contact, Impacts
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Stage, Validity
from ifrfit.physics.impulse_laws import impulse_factor
from ifrfit.physics.observables import Observable
from ifrfit.report.page.blocks import Paragraph, Report
from ifrfit.report.page.plugins import GENERATOR, ReportFormat, ReportSection
from ifrfit.report.page.report_input import ReportInput


def _grip(j: float) -> Coefficients:
    return Coefficients(0.0, 0.0, 0.0, 2.0 * rotational_share(j))


GRIP = Closure(
    "grip",
    "GRIP",
    _grip,
    "made up: k = min(2 g J/(1 + J), kappa/tau)",
    ClosureConstant(
        "g_rip", r"\Gamma", "grip, from 0 (frictionless) to 1 (full reversal)", lambda j: (0.0, 1.0)
    ),
)


@dataclass(frozen=True)
class Rooted:
    """k = min(share (1 + c^2), kappa/tau): not linear in its constant."""

    share: float

    def impulse(self, incidence: Any, c: Any, kappa: Any) -> Any:
        return impulse_factor(incidence, 0.0, self.bound(c), kappa)

    def slopes(self, incidence: Any, c: Any, kappa: Any) -> Any:
        _, sticks = self.impulse(incidence, c, kappa)
        with np.errstate(divide="ignore"):
            by_kappa = np.where(sticks, 0.0, 1.0 / incidence.tau)
        return np.where(sticks, self.bound_slope(c), 0.0), by_kappa

    def bound(self, c: Any) -> Any:
        return self.share * (1.0 + np.asarray(c) ** 2)

    def bound_slope(self, c: Any) -> Any:
        return 2.0 * self.share * np.asarray(c)

    def constant_at(self, bound: Any) -> Any:
        return np.sqrt(np.maximum(np.asarray(bound) / self.share - 1.0, 0.0))

    def for_many(self, count: int) -> Rooted:
        return self


BEND = Closure(
    "bend",
    "BEND",
    lambda j: Rooted(rotational_share(j)),
    "made up",
    ClosureConstant("eta", r"\eta", "root of the restitution in sticking", lambda j: (0.0, 1.0)),
)

SPIN_GAINED = Observable(
    name="spin_gained",
    symbol=r"$\Delta R\Omega_y/u$",
    meaning="spin gained",
    kind="tangential",
    value=lambda r, mu: r.spin_y - r.incidence.spin_y,
    linear=lambda i, j: (np.zeros_like(i.sine), -i.slip_x / j),
    low=-1e6,
    high=1e6,
    takes=frozenset({"Sy"}),
    numerator="spin",
    panel="r.spinY - r.i.spinY",
)

# curved, an angle, and without an expression for the panel
TILT = Observable(
    name="tilt_deg",
    symbol=r"$\vartheta$",
    meaning="velocity of the contact over that of the centre",
    unit="deg",
    kind="curved",
    value=lambda r, mu: np.degrees(np.arctan2(r.contact_x, 1.0 + r.v_n)),
    by_impulse=lambda i, k, e_n, j: np.degrees(
        np.arctan2((1.0 - k / rotational_share(j)) * i.slip_x, 1.0 + e_n * i.cosine)
    ),
    low=-90.0,
    high=90.0,
    takes=frozenset({"Tx", "Sy"}),
    with_e_n=True,
)

HALF_DROP = Observable(
    name="half_v_n",
    symbol=r"$v_n/2u$",
    meaning="half the normal velocity",
    kind="normal",
    value=lambda r, mu: 0.5 * r.v_n,
    by_e_n=lambda i: 0.5 * i.cosine,
    low=0.0,
    high=5.0,
    takes=frozenset({"N"}),
    numerator="velocity",
    panel="0.5 * r.vN",
)


@dataclass(frozen=True)
class Brake:
    """Takes a thousandth of the normal velocity after the contact."""

    name: str = "brake"
    title: str = "brake"
    stage: Stage = "rolling"
    replaces: Literal[""] = ""
    cost_ns: float = 5.0
    source: str = "made up"

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        return ""

    def validity(self, contact: Contact, impacts: Impacts) -> Validity:
        return Validity()

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        return Criterion("B", 1.0, 0.5)

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        out = bounce.done
        return replace(bounce, outcome=replace(out, v_n=0.5 * out.v_n, e_n=0.5 * out.e_n))


@dataclass(frozen=True, repr=False)
class Guess(Options):
    """Least squares under another name, with an option of its own."""

    name: ClassVar[str] = "guess"
    title: ClassVar[str] = "educated guess"
    label: ClassVar[str] = "guess"
    summary: ClassVar[str] = "an educated guess"
    courage: float = option(1.0, "guess: how bold it is.", form="number", metavar="X")

    def refuses(self, problem: Any) -> str:
        return "" if problem.error_model.is_plain else "it guesses at plain errors only."

    def run(
        self, problem: Any, optimum: Any, *, seed: int = 0, progress: Any = None, started: float | None = None
    ) -> Estimation:
        found = LeastSquares().run(problem, optimum)
        return replace(found, method=self.name, warnings=(f"courage {self.courage:g}",))


def _count(given: ReportInput) -> tuple[Paragraph, ...]:
    return (Paragraph(f"{len(given.result.points)} rows by {given.result.closure}."),)


def _outline(report: Report, stem: str) -> dict[str, bytes]:
    return {f"{stem}.outline": "\n".join([GENERATOR, *(each.title for each in report.sections)]).encode()}


COUNT = ReportSection("count", "How many rows", _count)
OUTLINE = ReportFormat("outline", _outline)
