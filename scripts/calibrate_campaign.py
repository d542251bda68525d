"""How often the intervals of a campaign's population hold the truth: campaigns drawn anew, read from files.

Each campaign draws its population (medians over the passive range, spread `TAUS` in the coordinate), the
groups of its `Scene`, and twelve impacts of each with known errors. Prints a table in Markdown, of e_n, e_t
and mu: how many populations there are, per cent of the intervals of 95 % that hold the truth, of medians also
where nothing is said of the constant (ends that cut, groups that leave it open, odd groups, two populations),
and per cent of the groups that are pooled. Bold is what is short.

    python scripts/calibrate_campaign.py 500 ten angles glass hundred
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import expit

from ifrfit.campaign.run import run_campaign
from ifrfit.physics import OBSERVABLES, rebound

TAUS = (0.0, 0.1, 0.3, 1.0)
LEVEL, ERRORS = 0.95, 3.0  # a share is short where it is lower by more than so many standard errors
IMPACTS, SIGMA = 12, 0.03
ANGLES, LOW = (3.0, 80.0), (3.0, 45.0)  # degrees
NAMES = ("e_n", "e_t", "mu")
KINDS = (
    "median group",
    "median, nothing said",
    "new group",
    "group, pooled",
    "group, alone",
    "groups pooled",
)
HEADER = "run,gamma_deg,beta,e_n,sigma_beta,sigma_e_n"
Range = tuple[float, float]
Counts = tuple[int, int]  # how many hold, of how many


@dataclass(frozen=True)
class Scene:
    """What campaigns are drawn.

    Attributes
    ----------
    groups : int
    grip : (float, float)
        Median of the logit of (e_t + 1) / 0.6, drawn uniformly.
    low : float
        Share of the groups whose angles end at 45 degrees, which may leave mu open.
    share : float
        Of the campaigns that are asked for.
    """

    groups: int = 10
    grip: Range = (-1.0, 1.5)
    low: float = 0.0
    share: float = 1.0


SCENES = {
    "ten": Scene(),
    "angles": Scene(low=0.5),
    "glass": Scene(grip=(-4.5, -2.0)),
    "hundred": Scene(groups=100, share=0.4),
}


def drawn(
    rng: np.random.Generator, tau: float, scene: Scene
) -> tuple[dict[str, float], list[dict[str, float]]]:
    """Constants of the median group, and of each group and one more."""
    middle = np.array([rng.uniform(0.5, 3.0), rng.uniform(*scene.grip), rng.uniform(-2.5, -1.2)])
    each = middle + tau * rng.standard_normal((scene.groups + 1, 3))

    def constants(y: np.ndarray) -> dict[str, float]:
        return {
            "e_n": float(expit(y[0])),
            "e_t": float(-1.0 + 0.6 * expit(y[1])),
            "mu": float(math.exp(y[2])),
        }

    return constants(middle), [constants(y) for y in each]


def write(path: Path, groups: list[dict[str, float]], rng: np.random.Generator, scene: Scene) -> None:
    """A table of impacts of the groups."""
    lines = [HEADER]
    for number, own in enumerate(groups):
        gamma = rng.uniform(*(LOW if number < scene.low * len(groups) else ANGLES), IMPACTS)
        state = rebound(gamma, degrees=True, **own)
        beta = OBSERVABLES["beta"].value(state, np.asarray(own["mu"])) + SIGMA * rng.standard_normal(IMPACTS)
        e_n = own["e_n"] + SIGMA * rng.standard_normal(IMPACTS)
        rows = zip(gamma.tolist(), beta.tolist(), e_n.tolist(), strict=True)
        lines += [f"{number},{g!r},{b!r},{e!r},{SIGMA},{SIGMA}" for g, b, e in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def intervals(rng: np.random.Generator, tau: float, scene: Scene) -> Iterator[tuple[tuple[str, str], Counts]]:
    """How many intervals of 95 % of one campaign hold the truth, by constant and kind of interval."""
    middle, groups = drawn(rng, tau, scene)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "impacts.csv"
        write(path, groups[:-1], rng, scene)
        found, _ = run_campaign([path], ["run"], Path(folder) / "out", lambda _: [], facts=False)
    for each in found.populations:
        name, n = each.name, each.groups.size
        if name not in middle:
            continue
        centre, new, members = each.centre, each.new, each.members
        truth = np.array([groups[int(found.keys[at][0])][name] for at in each.groups])
        low, high = (
            np.array([found.rows[at][f"{name}_{end}95"] for at in each.groups]) for end in ("lo", "hi")
        )
        median = int(centre.lo95 <= middle[name] <= centre.hi95)
        yield (name, "median group"), (median, 1)
        if not (each.cut or each.missed or each.outlying or each.two):
            yield (name, "median, nothing said"), (median, 1)
        yield (name, "new group"), (int(new.lo95 <= groups[-1][name] <= new.hi95), 1)
        yield (name, "group, pooled"), (int(((members.lo95 <= truth) & (truth <= members.hi95)).sum()), n)
        yield (name, "group, alone"), (int(((low <= truth) & (truth <= high)).sum()), n)
        yield (name, "groups pooled"), (n, n + each.limits + each.left_out)


def percentage(counts: Sequence[Counts], *, of_intervals: bool) -> str:
    """The share in per cent, bold where short by what campaigns scatter (one interval in each: binomial)."""
    if not counts:
        return "-"
    hold, n = np.array(counts, dtype=float).T
    share = hold.sum() / n.sum()
    error = math.sqrt(((hold - share * n) ** 2).sum()) / n.sum()
    said = f"{100.0 * share:.1f}"
    return f"**{said}**" if of_intervals and share < LEVEL - ERRORS * error else said


def main(campaigns: int, scenes: Sequence[str]) -> None:
    """Print the shares of e_n, e_t and mu, with the number of populations behind each."""
    print(f"| campaigns | sd over groups | populations | {' | '.join(KINDS)} |")
    print(f"|---|---|---|{'---|' * len(KINDS)}")
    for scene in scenes:
        rng = np.random.default_rng((20260, *scene.encode()))
        for tau in TAUS:
            seen: dict[tuple[str, str], list[Counts]] = defaultdict(list)
            for _ in range(round(campaigns * SCENES[scene].share)):
                for what, counts in intervals(rng, tau, SCENES[scene]):
                    seen[what].append(counts)
            cells = [", ".join(str(len(seen[name, KINDS[0]])) for name in NAMES)]
            for kind in KINDS:
                shares = [
                    percentage(seen[name, kind], of_intervals=kind != KINDS[-1])
                    + (f" of {len(seen[name, kind])}" if kind == KINDS[1] else "")
                    for name in NAMES
                ]
                cells.append(", ".join(shares))
            print(f"| {scene} | {tau:g} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100, sys.argv[2:] or list(SCENES))
