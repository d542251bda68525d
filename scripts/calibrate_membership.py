"""How often a campaign names groups as not of the population of the others: without reason, and with.

False alarms are counted in campaigns drawn anew and read from files, of 3 to 200 groups of twelve impacts, as
in `calibrate_campaign`; how often groups that are set off are found in normal populations whose groups are
known with an error of a third of tau. Prints tables in Markdown.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

import calibrate_campaign as campaigns
import numpy as np

from ifrfit.campaign.leave_one_out import outlying_groups
from ifrfit.campaign.normal_hierarchy import NormalHierarchy
from ifrfit.campaign.run import run_campaign

TAUS = (0.0, 0.1, 0.3, 1.0)
FEWEST, MOST = 3, 200
GROUPS = (5, 8, 12, 20, 50, 200)
DISTANCES = (3.0, 5.0, 10.0)
ERROR = 1 / 3


def false_alarms(rng: np.random.Generator, tau: float) -> Counter[str]:
    """What one campaign of one population named: populations looked at, groups in them, alarms."""
    campaigns.GROUPS = round(float(np.exp(rng.uniform(np.log(FEWEST), np.log(MOST)))))
    _, groups = campaigns.drawn(rng, tau)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "impacts.csv"
        campaigns.write(path, groups[:-1], rng)
        found, _ = run_campaign([path], ["run"], Path(folder) / "out", lambda _: [], facts=False)
    seen = [each for each in found.populations if each.outlying is not None]
    return Counter(
        campaigns=1,
        populations=len(seen),
        groups=sum(each.groups.size for each in seen),
        alarms=sum(bool(each.outlying) for each in seen),
        with_alarms=any(each.outlying for each in seen),
    )


def is_found(rng: np.random.Generator, n: int, offsets: list[float]) -> tuple[bool, bool]:
    """Whether all groups that are set off by so many tau are named, and whether another one is."""
    truth = rng.standard_normal(n)
    truth[: len(offsets)] = offsets
    named = outlying_groups(NormalHierarchy.of(rng.normal(truth, ERROR), np.full(n, ERROR))) or {}
    return set(range(len(offsets))) <= set(named), any(place >= len(offsets) for place in named)


def main(campaign_count: int, repeats: int) -> None:
    """Print both tables."""
    rng = np.random.default_rng(712)
    head = ("sd over groups", "campaigns", "populations", "groups in them")
    print(f"| {' | '.join(head)} | populations with an alarm | campaigns with one |")
    print("|---|---|---|---|---|---|")
    for tau in TAUS:
        seen: Counter[str] = Counter()
        for _ in range(campaign_count):
            seen += false_alarms(rng, tau)
        counts = (seen[name] for name in ("campaigns", "populations", "groups", "alarms", "with_alarms"))
        print(f"| {tau:g} | {' | '.join(map(str, counts))} |", flush=True)
    kinds = {f"one at {distance:g} tau": [distance] for distance in DISTANCES}
    kinds |= {"two at 10 tau": [10.0, 10.0], "two at 10 and -10 tau": [10.0, -10.0]}
    print(f"\n| groups | {' | '.join(kinds)} | half of them at 10 tau |")
    print(f"|---|{'---|' * (len(kinds) + 1)}")
    for n in GROUPS:
        cells = []
        for offsets in [*kinds.values(), [10.0] * (n // 2)]:
            found = [is_found(rng, n, offsets) for _ in range(repeats)]
            cells.append(f"{sum(all_named for all_named, _ in found)} of {repeats}")
            others = sum(other for _, other in found)
            if others:
                cells[-1] += f" ({others} name others)"
        print(f"| {n} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    given = [int(each) for each in sys.argv[1:3]]
    main(*given, *(150, 500)[len(given) :])
