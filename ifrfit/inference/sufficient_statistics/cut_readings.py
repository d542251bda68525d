"""Readings of a stream that were left out below the least value an observable can have: a cut by size.

One impossible cell must not refuse a thousand million impacts, so it is counted and left out, unless its
stated sigma explains it (`ifrfit.data.readings_below_zero`). Where noise made it all the same, as of v_n at
grazing incidence, the readings as far above stay, and the constants follow the noise.
"""

from __future__ import annotations

import math

from ifrfit.data.readings_below_zero import FURTHEST
from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.result.types import Fact
from ifrfit.inference.sufficient_statistics.accumulated import Accumulated
from ifrfit.inference.sufficient_statistics.moments import S_1
from ifrfit.physics.observables import OBSERVABLES

# Each is some 2.5 sigma from the law, one with the other: without them the constant that goes with slopes s
# moves by 2.5 times their sum of s/sigma over sqrt(sum of s^2/sigma^2 of those used), in its sd.
_MOVES = 0.1  # of that ratio: a quarter of an sd
_ROOM = 1.0  # degrees of incidence that a remedy must leave


def cut_readings(of: Accumulated) -> Fact | None:
    """Whether so many readings were left out for their size that the constants follow it.

    Returns
    -------
    Fact or None
        None where they are too few to matter, or none.
    """
    names = of.stream.observables
    for number, name in enumerate(names):
        if name not in of.tally.cut:
            continue
        count, least, gamma, pull = of.tally.cut[name]
        if pull < _MOVES * math.sqrt(float(of.sums[number :: len(names), :, S_1].sum())):
            continue
        low = OBSERVABLES[name].low
        ends = [known.least_gamma for known in of.groups[number :: len(names)]]
        others = [other for other in names if other != name]
        leaves_some = min(ends) + _ROOM < gamma < math.inf
        remedies = [f"--gamma-max {math.floor(10.0 * gamma) / 10.0:g}"] if leaves_some else []
        remedies += [f"--observable {' --observable '.join(others)}"] if others else []
        beyond, give = "", "State sigma of every observable, and they count; or leave"
        if of.stream.has_sigma:
            beyond, give = f" by more than {FURTHEST:g} sigma", "Correct them or their sigma; or leave"
        says = (
            f"{count:,} values of {name} below {low:g}{beyond}, down to {least:.3g}, were left out as "
            "impossible, and those as far above are used: where noise makes them, the constants follow it. "
            f"{give} out whole settings, not readings: "
            f"{' or '.join(remedies) or 'those at which noise reaches the end'}"
        )
        return Fact(False, says, {"observable": name, "end": low, "missing": count}, FACTS["truncation"])
    return None
