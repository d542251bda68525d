"""How often the intervals of a campaign's population hold the truth: campaigns drawn anew, read from files.

Each campaign draws its population (medians over the passive range, spread `TAUS` in the coordinate), ten
groups of it, and twelve impacts of each with known errors. Prints a table in Markdown.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.special import expit

from ifrfit.campaign.run import run_campaign
from ifrfit.physics import OBSERVABLES, rebound

TAUS = (0.0, 0.1, 0.3, 1.0)
GROUPS, IMPACTS, SIGMA = 10, 12, 0.03
HEADER = "run,gamma_deg,beta,e_n,sigma_beta,sigma_e_n"


def drawn(rng: np.random.Generator, tau: float) -> tuple[dict[str, float], list[dict[str, float]]]:
    """Constants of the median group, and of each group."""
    middle = np.array([rng.uniform(0.5, 3.0), rng.uniform(-1.0, 1.5), rng.uniform(-2.5, -1.2)])
    each = middle + tau * rng.standard_normal((GROUPS + 1, 3))

    def constants(y: np.ndarray) -> dict[str, float]:
        return {
            "e_n": float(expit(y[0])),
            "e_t": float(-1.0 + 0.6 * expit(y[1])),
            "mu": float(math.exp(y[2])),
        }

    return constants(middle), [constants(y) for y in each]


def write(path: Path, groups: list[dict[str, float]], rng: np.random.Generator) -> None:
    """A table of impacts of the groups."""
    lines = [HEADER]
    for number, own in enumerate(groups):
        gamma = rng.uniform(3.0, 80.0, IMPACTS)
        state = rebound(gamma, degrees=True, **own)
        beta = OBSERVABLES["beta"].value(state, np.asarray(own["mu"])) + SIGMA * rng.standard_normal(IMPACTS)
        e_n = own["e_n"] + SIGMA * rng.standard_normal(IMPACTS)
        rows = zip(gamma.tolist(), beta.tolist(), e_n.tolist(), strict=True)
        lines += [f"{number},{g!r},{b!r},{e!r},{SIGMA},{SIGMA}" for g, b, e in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def intervals(rng: np.random.Generator, tau: float) -> Iterator[tuple[tuple[str, str], bool]]:
    """Whether each interval of 95 % of one campaign holds the truth, by constant and kind of interval."""
    middle, groups = drawn(rng, tau)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "impacts.csv"
        write(path, groups[:-1], rng)
        found, _ = run_campaign([path], ["run"], Path(folder) / "out", lambda _: [], facts=False)
    for each in found.populations:
        name = each.name
        if name not in middle:
            continue
        yield (name, "centre"), bool(each.centre.lo95 <= middle[name] <= each.centre.hi95)
        yield (name, "new"), bool(each.new.lo95 <= groups[-1][name] <= each.new.hi95)
        for place, at in enumerate(each.groups):
            truth, row = groups[int(found.keys[at][0])][name], found.rows[at]
            yield (name, "pooled"), bool(each.members.lo95[place] <= truth <= each.members.hi95[place])
            yield (name, "alone"), bool(row[f"{name}_lo95"] <= truth <= row[f"{name}_hi95"])


def main(campaigns: int) -> None:
    """Print the shares, with the number of intervals behind each."""
    rng = np.random.default_rng(20260)
    print("| sd over groups | constant | median group | new group | group, pooled | group, alone |")
    print("|---|---|---|---|---|---|")
    for tau in TAUS:
        held: dict[tuple[str, str], list[bool]] = {}
        for _ in range(campaigns):
            for what, inside in intervals(rng, tau):
                held.setdefault(what, []).append(inside)
        for name in ("e_n", "e_t", "mu"):
            shares = (held[name, what] for what in ("centre", "new", "pooled", "alone"))
            cells = " | ".join(f"{sum(each)} of {len(each)}" for each in shares)
            print(f"| {tau:g} | {name} | {cells} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
