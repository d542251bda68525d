"""Chains until their standard errors are as small as asked, or until the time is over."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from scipy import special

from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.request import Request
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.text import power_of_ten

if TYPE_CHECKING:
    from ifrfit.inference.mcmc import Chains, Coordinates, Evidence

MOST_DRAWS = 10_000_000
_TYPICAL = 5.0  # draws that make an effective one
_NEXT = 0.25  # steps until the next look, of those behind
FIRST = 200  # steps before the first look
FEWEST = 50  # steps of who insists on chains
_BESIDE = 1.5  # time of a step over that of its densities
# of an end of a 95 % interval: sqrt(p (1 - p))/density of a normal law, over the root of effective draws
_DENSITY = math.exp(-0.5 * float(special.ndtri(LEVELS[0])) ** 2) / math.sqrt(2.0 * math.pi)
END = math.sqrt(LEVELS[0] * (1.0 - LEVELS[0])) / _DENSITY


def standard_error(evidence: Evidence) -> float:
    """Largest standard error of a mean, an sd or an end of a 95 % interval, in standard deviations.

    Of effective draws N a mean has the error 1/sqrt(N) and an end 2.67/sqrt(N), as of a normal law; that of
    an sd is smaller than either.
    """
    bulk, tail = min(evidence.bulk.values()), min(evidence.tail.values())
    return max(_root(bulk), END * _root(tail))


def _root(effective: float) -> float:
    return math.inf if effective <= 0.0 else 1.0 / math.sqrt(effective)


def reachable() -> float:
    """The accuracy that a sensible number of draws comes to, as a rule."""
    return END * math.sqrt(_TYPICAL / MOST_DRAWS)


def check_reachable(request: Request, why: str) -> None:
    """Refuse an accuracy that would take chains absurdly long.

    Parameters
    ----------
    request : Request
    why : str
        Why not exact.

    Raises
    ------
    UsageError
        With the accuracy that is reachable.
    """
    if request.accuracy is None or request.accuracy >= reachable():
        return
    needed = (END / request.accuracy) ** 2
    remedy = f"ask for {power_of_ten(reachable())} or more" + ("" if why else ", or leave --method mcmc out")
    raise UsageError(
        f"--accuracy {power_of_ten(request.accuracy)} takes chains {needed:.0e} independent draws: {remedy}."
        + (f" Exact is out of the question: {why}" if why else "")
    )


def halting(request: Request, rules: Callable[[Evidence], bool]) -> Callable[[Evidence], bool]:
    """When a walk may end: every rule holds and the error is as asked, or the next stretch would be late.

    Parameters
    ----------
    request : Request
    rules : callable
        Whether the chains agree, as `ifrfit.inference.mcmc.stopping.is_met`.
    """
    begin = request.clock()

    def halt(evidence: Evidence) -> bool:
        if request.accuracy is not None and standard_error(evidence) <= request.accuracy and rules(evidence):
            return True
        # without an accuracy the time is used up
        return _NEXT * (request.clock() - begin) > request.left

    return halt


def steps_within(coordinates: Coordinates, chains: Chains, request: Request) -> int:
    """Steps of each ensemble that fit into what is left, by the density's time, or make `MOST_DRAWS`.

    Parameters
    ----------
    coordinates : Coordinates
    chains : Chains
        Before their first step.
    request : Request
    """
    most = int(MOST_DRAWS // sum(rest.at.shape[0] for rest in chains.ends))
    if request.budget is None:
        return most
    begin = request.clock()
    for rest in chains.ends:
        coordinates(rest.at)
    step = _BESIDE * (request.clock() - begin)
    return min(most, int(max(request.left, 0.0) / step)) if step > 0.0 else most
