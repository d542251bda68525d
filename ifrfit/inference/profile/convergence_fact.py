"""Whether every profile of a fit came to its end."""

from __future__ import annotations

from collections.abc import Mapping

from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.profile.types import ProfileLikelihood
from ifrfit.inference.result.types import Fact


def profile_converged(profiles: Mapping[str, ProfileLikelihood], noise: Fact) -> Fact:
    """Whether the noise settled, and every profile closes or reaches the end of its domain.

    Parameters
    ----------
    profiles : mapping
        Name to `ProfileLikelihood`, as `profile_all` returns them.
    noise : Fact
        "converged" of the least squares behind them.

    Returns
    -------
    Fact
        Its figures are those of `noise`, the number of profiles, and the names of those that a budget
        stopped.
    """
    stopped = {name: profile.stopped for name, profile in profiles.items() if profile.stopped}
    figures = {**noise.figures, "n_profiles": len(profiles), "stopped": list(stopped)}
    if not noise.ok:
        says = noise.says
    elif stopped:
        first, why = next(iter(stopped.items()))
        names = f"profile of {first} was" if len(stopped) == 1 else f"profiles of {', '.join(stopped)} were"
        says = f"the {names} stopped early ({why}): compare the intervals with --method exact"
    else:
        says = f"{noise.says}, and every profile closes or reaches the end of its domain"
    return Fact(noise.ok and not stopped, says, figures, FACTS["converged"])
