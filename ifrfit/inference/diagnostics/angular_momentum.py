"""Whether velocities and spins of raw impacts close: momentum in, momentum out."""

from __future__ import annotations

from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.result.types import Fact


def angular_momentum(problem: Problem, slips: Fact | None) -> Fact:
    """Whether velocities and spins of raw impacts close, source by source.

    Where a slip explains the residuals and another inertia factor does not, none is advised.
    """
    checks = problem.observations.momentum
    figures = {
        "sources": [
            {name: getattr(c, name) for name in ("source", "n", "rms", "n_violating", "suggested")}
            for c in checks
        ]
    }
    bad = [check for check in checks if not check.ok]
    if bad and slips is not None and not slips.ok and "inertia-factor" not in slips.figures["called"]:
        misses = "; ".join(f"{check.source}: {check.miss}{check.unit_of_spins}" for check in bad)
        says = f"{misses}. Mend the slip in the table first, and see whether it closes then"
    else:
        says = " ".join(check.says for check in (bad or checks)).rstrip(".")
    return Fact(not bad, says, figures, FACTS["angular_momentum"])
