"""Let effects act on impacts in their one order, and find out which of them a scene calls for."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import DataError
from ifrfit.physics.angles import Array
from ifrfit.physics.effects.contact import Contact, Impacts
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import ORDER, Criterion
from ifrfit.physics.effects.registry import EFFECTS
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.rebound import Rebound, friction_impulse, rebound_with

PILOT = 400  # impacts of the scene on which its plan is made, beside the extreme ones
Requested = Literal["auto"] | tuple[str, ...]  # names of effects
State = Literal["on", "off", "constant", "refused", "unknown"]


def compose(contact: Contact, impacts: Impacts, on: Collection[str]) -> Outcome:
    """Compute impacts with these effects and no others.

    Parameters
    ----------
    contact : Contact
    impacts : Impacts
    on : collection of str
        Names of effects.

    Returns
    -------
    Outcome
        Of the shape of the impacts.

    Notes
    -----
    The order is plane of motion, normal restitution, adhesion, tangential law, rolling friction, fluid. So
    friction presses with the normal impulse of the dry contact, adhesion included.
    """
    bounce = Bounce.before(impacts)
    for stage in ORDER:
        for name, effect in EFFECTS.items():
            if name in on and effect.stage == stage:
                bounce = effect.apply(contact, impacts, bounce)
        if stage == "tangential":
            bounce = _after_contact(contact, impacts, bounce)
    return bounce.done


def with_effect(names: Collection[str], more: str) -> list[str]:
    """These effects and one more, which takes the place of any that replaces the same constant."""
    same = EFFECTS[more].replaces
    return [n for n in names if n != more and (not same or EFFECTS[n].replaces != same)] + [more]


def _after_contact(contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
    """The closure's impulse, unless an effect has given one, and velocities and spins after it.

    Without lateral spin components that are zero are not computed; the others are the same to the last bit.
    """
    k, sticking = bounce.impulse or _closure(contact, impacts, bounce)
    incidence, e_n, j = bounce.incidence, bounce.e_n, contact.inertia_factor
    if bounce.lateral:
        state = rebound_with(incidence, k, sticking, e_n, j)
    else:
        push, none = k * incidence.slip_x, np.broadcast_to(0.0, k.shape)
        state = Rebound(
            v_x=incidence.sine - push,
            v_y=none,
            v_n=e_n * incidence.cosine,
            spin_x=none,
            spin_y=incidence.spin_y - push / j,
            sticking=sticking,
            impulse_factor=k,
            incidence=incidence,
            e_n=e_n,
            inertia_factor=j,
        )
    return replace(bounce, outcome=Outcome(**vars(state), captured=bounce.captured, impulsive=state))


def _closure(contact: Contact, impacts: Impacts, bounce: Bounce) -> tuple[Array, NDArray[np.bool_]]:
    if impacts.constant is None:
        raise ValueError("the closure needs its constant where compliance is off")
    kappa = friction_impulse(impacts.mu, bounce.e_n)
    return impacts.closure.law(contact.inertia_factor).impulse(bounce.incidence, impacts.constant, kappa)


@dataclass(frozen=True)
class PlanLine:
    """What the plan says of one effect.

    Attributes
    ----------
    effect, title : str
    state : str
        on; off; constant: it would replace a constant that is given, and stays off; refused: its law does
        not hold here; unknown: numbers are missing.
    criterion : Criterion or None
        None where numbers are missing.
    change : float or None
        Largest change of an observable that it makes (angles in radians); infinite where it decides
        whether the observable exists; None where numbers are missing, or nothing to compare with.
    observable : str
        The one that changes most.
    reason : str
        In a few words.
    remark : str
        On the range of its law; may be empty.
    alarm : bool
        It is off although it would change an observable by more than the accuracy.
    """

    effect: str
    title: str
    state: State
    criterion: Criterion | None
    change: float | None
    observable: str
    reason: str
    remark: str = ""
    alarm: bool = False


@dataclass(frozen=True)
class Plan:
    """The effects of a scene.

    Attributes
    ----------
    lines : tuple of PlanLine
        One an effect, in the order in which they compose.
    accuracy : float
    dropped : float
        Change by all effects together that were dropped for being small.
    """

    lines: tuple[PlanLine, ...]
    accuracy: float
    dropped: float

    @property
    def on(self) -> tuple[str, ...]:
        """Names of the effects to compute."""
        return tuple(line.effect for line in self.lines if line.state == "on")


def make_plan(
    contact: Contact,
    impacts: Impacts,
    observables: Sequence[str],
    *,
    accuracy: float,
    requested: Requested = "auto",
    given: Mapping[str, str] | None = None,
) -> Plan:
    """Decide which effects to compute.

    Parameters
    ----------
    contact : Contact
    impacts : Impacts
        With one dimension.
    observables : sequence of str
        Whose changes count.
    accuracy : float
        Change of an observable that is allowed to all dropped effects together (angles in radians).
    requested : "auto" or tuple of str
        Names of the effects to compute, whatever they change.
    given : mapping
        Constants that the user gave: ``e_n``, ``tangential``, to their names as in the scene.

    Returns
    -------
    Plan

    Raises
    ------
    DataError
        If a wanted effect cannot be computed, or no single law of e_n is left to choose.

    Notes
    -----
    auto drops the effect that changes least, then the next, as long as all that was dropped together
    changes no observable by more than `accuracy` on the pilot impacts. An effect is judged by leaving it
    out of everything that can be computed, so that effects which are strong together are not taken for weak.
    """
    pilot = impacts.take(pilot_rows(impacts))
    planner = _Planner(contact, pilot, tuple(observables), accuracy, requested, dict(given or {}))
    return planner.plan()


def pilot_rows(impacts: Impacts) -> NDArray[np.intp]:
    """Rows evenly through the scene, and the extreme ones in everything the effects depend on.

    Parameters
    ----------
    impacts : Impacts
        With one dimension.

    Returns
    -------
    ndarray of int
        All rows where there are no more than 400.
    """
    n = impacts.speed.size
    if n <= PILOT:
        return np.arange(n)
    columns: list[NDArray[np.float64]] = [
        impacts.normal_speed,
        impacts.radius,
        impacts.normal_speed * impacts.radius,
        impacts.incidence.tau,
        impacts.incidence.slip,
        np.abs(impacts.incidence.spin_x),
        impacts.e_n,
        impacts.mu,
    ]
    moving = np.flatnonzero(impacts.normal_speed > 0.0)
    rows = [np.linspace(0, n - 1, PILOT).astype(np.intp)]
    for column in columns:
        rows.append(np.array([np.argmin(column), np.argmax(column)]))
        if moving.size:
            rows.append(moving[[np.argmin(column[moving]), np.argmax(column[moving])]])
    return np.unique(np.concatenate(rows))


def differences(one: Outcome, two: Outcome, mu: Array, observables: Sequence[str]) -> dict[str, float]:
    """Largest difference of each observable, angles in radians.

    Parameters
    ----------
    one, two : Outcome
        Of the same impacts.
    mu : ndarray
        Friction of each impact.
    observables : sequence of str
        Names in the common schema.

    Returns
    -------
    dict of str to float
        Infinite where a value exists in one of them only. At grazing incidence, where nothing approaches
        the wall, restitution is not compared.
    """
    return {name: _largest(name, one, two, mu) for name in observables}


def _largest(name: str, one: Outcome, two: Outcome, mu: Array) -> float:
    observable = OBSERVABLES[name]
    first, second = (np.asarray(observable.value(outcome, mu)) for outcome in (one, two))
    gap = np.abs(first - second)
    if observable.unit == "deg":
        gap = np.radians(np.minimum(gap, 360.0 - gap))
    undefined = np.isnan(first) & np.isnan(second)
    gap = np.where(undefined, 0.0, np.where(np.isnan(gap), math.inf, gap))
    if name == "e_n":
        gap = np.where(one.incidence.cosine > 0.0, gap, 0.0)
    return float(np.max(gap, initial=0.0))


@dataclass(frozen=True)
class _Planner:
    contact: Contact
    impacts: Impacts
    observables: tuple[str, ...]
    accuracy: float
    requested: Requested
    given: Mapping[str, str]

    def plan(self) -> Plan:
        lacking = {name: effect.lacks(self.contact, self.impacts) for name, effect in EFFECTS.items()}
        usable = [name for name, what in lacking.items() if not what]
        valid = {name: EFFECTS[name].validity(self.contact, self.impacts) for name in usable}
        replacing = {name for name in usable if EFFECTS[name].replaces in self.given}
        invalid = {name: v.words for name, v in valid.items() if not v.holds}
        self._check_requested(lacking | invalid)
        refused = {name for name in usable if not valid[name].holds and not self._needed(name)}
        laws = [n for n in usable if EFFECTS[n].replaces == "e_n" and n not in replacing]
        self._check_restitution(laws)
        # in a list, a law of e_n that is not named has another in its place
        replacing |= {n for n in laws if self.requested != "auto" and n not in self.requested}
        # the law of a refused effect is still a bound: it may be dropped as too small, but never be on
        computed = [name for name in usable if name not in replacing | refused]
        everything = compose(self.contact, self.impacts, computed)
        # in a list, what is not on is judged by adding it, else by leaving it out of everything
        base = [n for n in computed if self.requested == "auto" or n in self.requested or self._needed(n)]
        changes: dict[str, tuple[float, str]] = {}
        for name in usable:
            less = [n for n in base if n != name]
            changes[name] = self._change(base, less if name in base else with_effect(base, name))
        dropped, together = self._drop(computed, refused, changes)
        lines = []
        for name in EFFECTS:
            effect, remark = EFFECTS[name], valid[name].words if name in valid else ""
            if name not in usable:
                lines.append(PlanLine(name, effect.title, "unknown", None, None, "", lacking[name]))
                continue
            criterion = effect.criterion(self.contact, self.impacts, everything, self.accuracy)
            change, observable = changes[name]
            state, reason = self._verdict(name, change, replacing, refused, dropped)
            # a law of e_n that does not act here has nothing to say about a constant that is given
            acts = state != "constant" or criterion.met
            if state == "constant" and acts and change > self.accuracy:
                reason += f"; remove {self.given[effect.replaces]} to compute it"
            alarm = state != "on" and acts and change > self.accuracy
            # without the closure's constant there is nothing to compare with
            shown = None if effect.replaces == "tangential" and self._needed(name) else change
            lines.append(
                PlanLine(name, effect.title, state, criterion, shown, observable, reason, remark, alarm)
            )
        return Plan(tuple(lines), self.accuracy, together)

    def _check_requested(self, obstacles: Mapping[str, str]) -> None:
        """Refuse a list that asks for what cannot be computed, and a closure without its constant."""
        for name in self.requested if self.requested != "auto" else ():
            constant = self.given.get(EFFECTS[name].replaces)
            if constant is not None:
                raise DataError(f"effects lists {name}, which computes what {constant} gives. Remove one.")
            if obstacles[name]:
                raise DataError(
                    f"effects lists {name}, but {obstacles[name]}. Change that, or take {name} off."
                )
        laws = {name: obstacles[name] for name, e in EFFECTS.items() if e.replaces == "tangential"}
        if self.impacts.constant is None and all(laws.values()):
            law, obstacle = next(iter(laws.items()))
            raise DataError(
                f"constants.{self.impacts.closure.constant} is missing, and {law} cannot take its place: "
                f"{obstacle}."
            )

    def _check_restitution(self, laws: Sequence[str]) -> None:
        """Refuse anything but one law of e_n, or a constant."""
        chosen = [name for name in laws if self.requested == "auto" or name in self.requested]
        if "e_n" in self.given or len(chosen) == 1:
            return
        if chosen:
            raise DataError(
                f"e_n could be computed by {' or '.join(chosen)}, and their losses are not known together. "
                "List one of them in effects, or give constants.e_n."
            )
        raise DataError(
            "constants.e_n is missing, and nothing computes it. Give it, or what one of "
            f"{', '.join(n for n, e in EFFECTS.items() if e.replaces == 'e_n')} needs."
        )

    def _needed(self, name: str) -> bool:
        """Whether nothing can be computed without it."""
        if EFFECTS[name].stage == "plane":
            return bool(np.any(self.impacts.incidence.spin_x != 0.0))
        return EFFECTS[name].replaces == "tangential" and self.impacts.constant is None

    def _change(self, one: Sequence[str], two: Sequence[str]) -> tuple[float, str]:
        """Largest change between two sets of effects, and the observable it happens to."""
        if self.impacts.constant is None:
            laws = [any(EFFECTS[name].replaces == "tangential" for name in names) for names in (one, two)]
            if laws[0] != laws[1]:
                return math.inf, self.observables[0]
        first, second = (compose(self.contact, self.impacts, names) for names in (one, two))
        found = differences(first, second, self.impacts.mu, self.observables)
        observable = max(found, key=lambda name: found[name])
        return found[observable], observable

    def _drop(
        self, computed: list[str], refused: set[str], changes: Mapping[str, tuple[float, str]]
    ) -> tuple[list[str], float]:
        """The effects to drop, least first, and what they change together."""
        bounds = [name for name in refused if changes[name][0] <= self.accuracy]
        full = [*computed, *bounds]
        if self.requested != "auto":
            drop = [name for name in full if name not in self.requested and not self._needed(name)]
            return drop, self._change(full, [n for n in full if n not in drop])[0]
        together = self._change(full, computed)[0]
        dropped = list(bounds)
        for name in sorted(computed, key=lambda name: changes[name][0]):
            if self._needed(name) or changes[name][0] > self.accuracy:
                continue
            trial = [*dropped, name]
            change, _ = self._change(full, [n for n in full if n not in trial])
            if change > self.accuracy:
                break
            dropped, together = trial, change
        return dropped, together

    def _verdict(
        self,
        name: str,
        change: float,
        replacing: set[str],
        refused: set[str],
        dropped: Collection[str],
    ) -> tuple[State, str]:
        small = change <= self.accuracy
        if name in replacing:
            constant = self.given.get(EFFECTS[name].replaces)
            if constant is None:
                return "off", "not listed"
            return "constant", f"{constant} is given and stays"
        if name in refused:
            return ("off", "") if small else ("refused", "not computed")
        if EFFECTS[name].stage == "plane":
            return ("on", "in 3-D") if self._needed(name) else ("off", "planar")
        if name not in dropped:
            if self.requested != "auto":
                return "on", "listed"
            if self._needed(name):
                return "on", "takes the place of the closure's constant"
            return "on", "" if not small else "small, but with the dropped ones too much"
        if self.requested != "auto":
            return "off", "not listed"
        return "off", ""
