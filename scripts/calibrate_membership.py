"""How often a campaign names groups as not of the population of the others: without reason, and with.

False alarms are counted in campaigns drawn anew and read from files, of 3 to 200 groups of twelve impacts, as
in `calibrate_campaign`, and in many more of 10 to 1,000 groups whose posteriors are drawn: of four constants,
each of which has its own share between what groups are known to and what they differ by, and two of which are
known so weakly (to a quarter at worst) that what groups say is skewed. How often groups that are set off are
found is counted in normal populations whose groups are known with an error of a third of tau. Prints tables
in Markdown.

    python scripts/calibrate_membership.py 150 500 2000
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

import calibrate_campaign as campaigns
import numpy as np
from scipy import stats

from ifrfit.campaign.population.coordinate import Coordinate
from ifrfit.campaign.population.group_likelihood import likelihood_moments
from ifrfit.campaign.population.leave_one_out import FEWEST_OF_SEVERAL, outlying_groups
from ifrfit.campaign.population.normal_hierarchy import NormalHierarchy
from ifrfit.campaign.population.two_populations import two_populations
from ifrfit.campaign.run import run_campaign
from ifrfit.inference.distributions.protocol import LEVELS

TAUS = (0.0, 0.1, 0.3, 1.0)
FEWEST, MOST = 3, 200
GROUPS = (5, 8, 12, 20, 50, 200)
DISTANCES = (3.0, 5.0, 10.0)
ERROR = 1 / 3


def false_alarms(rng: np.random.Generator, tau: float) -> Counter[str]:
    """What one campaign of one population named: populations looked at, groups in them, alarms."""
    scene = campaigns.Scene(groups=round(float(np.exp(rng.uniform(np.log(FEWEST), np.log(MOST))))))
    _, groups = campaigns.drawn(rng, tau, scene)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "impacts.csv"
        campaigns.write(path, groups[:-1], rng, scene)
        found, _ = run_campaign([path], ["run"], Path(folder) / "out", lambda _: [], facts=False)
    seen = [each for each in found.populations if each.outlying is not None]
    return Counter(
        campaigns=1,
        populations=len(seen),
        groups=sum(each.groups.size for each in seen),
        alarms=sum(bool(each.outlying) for each in seen),
        two=sum(each.two is not None for each in seen),
        with_alarms=any(each.outlying or each.two is not None for each in seen),
    )


def drawn_alarms(rng: np.random.Generator) -> Counter[str]:
    """What one campaign of drawn posteriors named."""
    n = round(float(np.exp(rng.uniform(np.log(10), np.log(1000)))))
    odd, two = [], []
    for number in range(4):
        weak = number % 2 == 0
        relative = rng.uniform(0.05, 0.25) if weak else 0.01
        tau = float(rng.choice((0.0, 0.3, 1.0, 3.0, 10.0))) * relative
        error = relative * np.exp(rng.uniform(-0.5, 0.0, n))  # groups of more impacts and of fewer
        x = np.exp(min(tau, 0.5) * rng.standard_normal(n))
        y = rng.normal(x, error)
        five = stats.truncnorm(-y / error, np.inf, y, error).ppf(np.array(LEVELS)[:, None])
        # such as are not below a fifth of the median are determined
        told = five[0] > (0.2 if weak else 0.0)
        by = Coordinate(0.0, np.inf)
        mean, sd = likelihood_moments(by.to(five[:, told]), by)
        if told.sum() < 10:
            continue
        odd.append(bool(outlying_groups(NormalHierarchy.of(mean, sd))))
        two.append(two_populations(mean, sd) is not None)
    return Counter(
        campaigns=1,
        populations=len(odd),
        alarms=sum(odd),
        two=sum(two),
        with_alarms=any(odd) or any(two),
    )


def are_two(rng: np.random.Generator, n: int, distance: float, share: float) -> bool:
    """Whether a share of the groups that lies so many tau off is named a population of its own."""
    truth = rng.standard_normal(n) + distance * (np.arange(n) < round(share * n))
    return two_populations(rng.normal(truth, ERROR), np.full(n, ERROR)) is not None


def is_found(rng: np.random.Generator, n: int, offsets: list[float]) -> tuple[bool, bool]:
    """Whether all groups that are set off by so many tau are named, and whether another one is."""
    truth = rng.standard_normal(n)
    truth[: len(offsets)] = offsets
    named = outlying_groups(NormalHierarchy.of(rng.normal(truth, ERROR), np.full(n, ERROR))) or {}
    return set(range(len(offsets))) <= set(named), any(place >= len(offsets) for place in named)


def main(campaign_count: int, repeats: int, drawn_count: int) -> None:
    """Print the tables."""
    rng = np.random.default_rng(712)
    head = ("sd over groups", "campaigns", "populations", "groups in them", "odd groups", "two populations")
    print(f"| {' | '.join(head)} | campaigns with either |")
    print("|---|---|---|---|---|---|---|")
    parts = ("campaigns", "populations", "groups", "alarms", "two", "with_alarms")
    for tau in TAUS:
        seen: Counter[str] = Counter()
        for _ in range(campaign_count):
            seen += false_alarms(rng, tau)
        print(f"| {tau:g} | {' | '.join(str(seen[name]) for name in parts)} |", flush=True)
    seen = Counter()
    for _ in range(drawn_count):
        seen += drawn_alarms(rng)
    print(f"\ndrawn posteriors: {dict(seen)}", flush=True)
    kinds = {f"one at {distance:g} tau": [distance] for distance in DISTANCES}
    kinds |= {"two at 10 tau": [10.0, 10.0], "two at 10 and -10 tau": [10.0, -10.0]}
    print(f"\n| groups | {' | '.join(kinds)} |")
    print(f"|---|{'---|' * len(kinds)}")
    for n in GROUPS:
        cells = []
        for offsets in kinds.values():
            found = [is_found(rng, n, offsets) for _ in range(repeats)]
            cells.append(f"{sum(all_named for all_named, _ in found)} of {repeats}")
            others = sum(other for _, other in found)
            if others:
                cells[-1] += f" ({others} name others)"
        print(f"| {n} | {' | '.join(cells)} |", flush=True)
    halves = [(0.5, 4.0), (0.5, 6.0), (0.5, 10.0), (0.25, 6.0), (0.25, 10.0)]
    print(f"\n| groups | {' | '.join(f'{share:.0%} at {distance:g} tau' for share, distance in halves)} |")
    print(f"|---|{'---|' * len(halves)}")
    for n in (size for size in GROUPS if size >= FEWEST_OF_SEVERAL):
        each = (sum(are_two(rng, n, d, share) for _ in range(repeats)) for share, d in halves)
        print(f"| {n} | {' | '.join(f'{found} of {repeats}' for found in each)} |", flush=True)


if __name__ == "__main__":
    given = [int(each) for each in sys.argv[1:4]]
    main(*given, *(150, 500, 2000)[len(given) :])
