"""Is the truth where the intervals say? The test that all methods, and the controls, go through.

Every line (one scene, method and quantity) gives four tests: chi2 of the histogram of ranks against the
uniform law, and the exact two-sided binomial test of the coverage of the 50, 68 and 95 % intervals. Holm's
step-down rule over all tests of a method keeps the chance of any false alarm below `FAMILY`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special
from studies import bold, markdown

Array = NDArray[np.float64]

FAMILY = 1e-3  # chance that a right method fails any of its tests
BINS = 20
LEVELS = (0.50, 0.68, 0.95)
EVERYWHERE = "all scenes"


@dataclass(frozen=True)
class Line:
    """One quantity of one method in one scene.

    Attributes
    ----------
    scene, method, name : str
    n : int
        Experiments that gave an interval.
    absent : int
        Experiments that gave none.
    coverage : tuple of float
        Share of the intervals of each level that hold the truth; nan where the method has none.
    p_coverage : tuple of float
        Of the binomial tests.
    histogram : tuple of int
        Ranks in `BINS` equal bins; empty where the method has none.
    p_ranks : float
        Of the chi2 test of the histogram.
    adjusted : float
        Smallest p of the line by Holm's rule over all tests of the method.
    """

    scene: str
    method: str
    name: str
    n: int
    absent: int
    coverage: tuple[float, ...]
    p_coverage: tuple[float, ...]
    histogram: tuple[int, ...]
    p_ranks: float
    adjusted: float = math.nan

    @property
    def holds(self) -> bool:
        """Whether every test of the line is passed; a line without experiments is not."""
        return self.n > 0 and self.adjusted > FAMILY

    @property
    def errors(self) -> tuple[float, ...]:
        """Binomial standard error of the coverage where it is what it should be."""
        return tuple(math.sqrt(level * (1.0 - level) / max(self.n, 1)) for level in LEVELS)

    @property
    def tests(self) -> tuple[float, ...]:
        """All p values of the line that exist."""
        return tuple(p for p in (*self.p_coverage, self.p_ranks) if not math.isnan(p))

    @property
    def verdict(self) -> str:
        """In words."""
        if self.holds:
            return "holds"
        faults = []
        known = [p for p in self.p_coverage if p <= FAMILY]
        if known:
            worst = self.p_coverage.index(min(known))
            faults.append("too narrow" if self.coverage[worst] < LEVELS[worst] else "too wide")
        if self.p_ranks <= FAMILY:
            faults.append("ranks not uniform")
        return "FAILS: " + (", ".join(faults) or "no intervals")


def binomial_p(k: int, n: int, p: float) -> float:
    """Two-sided p of k of n where each happens with probability p: twice the smaller tail."""
    below = float(special.bdtr(k, n, p))
    above = 1.0 if k == 0 else float(special.bdtrc(k - 1, n, p))
    return min(1.0, 2.0 * min(below, above))


def histogram_p(counts: Sequence[int]) -> float:
    """p of chi2 of the counts against equal expectations."""
    observed = np.asarray(counts, dtype=float)
    expected = observed.sum() / observed.size
    return float(special.chdtrc(observed.size - 1, float(((observed - expected) ** 2).sum() / expected)))


def bin_limits(n: int, level: float = 0.95) -> tuple[int, int]:
    """Counts between which all bins of a uniform histogram lie together with at least the given chance."""
    tail = 0.5 * (1.0 - level) / BINS
    counts = np.arange(n + 1)
    below = special.bdtr(counts, n, 1.0 / BINS)
    return int(counts[below > tail][0]), int(counts[below >= 1.0 - tail][0])


def line_of(scene: str, method: str, name: str, scores: Array, asked: int) -> Line:
    """Judge the scores of one quantity.

    Parameters
    ----------
    scene, method, name : str
    scores : ndarray
        (n, 4): rank, and 1 or 0 for each level; columns of nan where the method has none.
    asked : int
        Experiments that the method was given.
    """
    n = len(scores)
    coverage, p_coverage = [], []
    for column, level in zip(scores[:, 1:].T, LEVELS, strict=True):
        known = n > 0 and bool(np.isfinite(column).all())
        coverage.append(float(column.mean()) if known else math.nan)
        p_coverage.append(binomial_p(int(column.sum()), n, level) if known else math.nan)
    ranked = n > 0 and bool(np.isfinite(scores[:, 0]).all())
    counts: tuple[int, ...] = ()
    if ranked:
        bins = np.clip((scores[:, 0] * BINS).astype(int), 0, BINS - 1)
        counts = tuple(int(x) for x in np.bincount(bins, minlength=BINS))
    p_ranks = histogram_p(counts) if ranked else math.nan
    return Line(scene, method, name, n, asked - n, tuple(coverage), tuple(p_coverage), counts, p_ranks)


def judge(lines: Sequence[Line]) -> list[Line]:
    """Give the lines of one method their adjusted p values, by Holm's rule over all their tests."""
    tests = [(p, i) for i, line in enumerate(lines) for p in line.tests]
    adjusted = [math.inf] * len(lines)
    running = 0.0
    for rank, (p, i) in enumerate(sorted(tests)):
        running = max(running, min(1.0, (len(tests) - rank) * p))
        adjusted[i] = min(adjusted[i], running)
    return [
        replace(line, adjusted=math.nan if math.isinf(p) else p)
        for line, p in zip(lines, adjusted, strict=True)
    ]


def lines_of(
    scores: Mapping[tuple[str, str, str], Array], asked: Mapping[tuple[str, str], int]
) -> list[Line]:
    """Judge every method, scene by scene and over all scenes together.

    Parameters
    ----------
    scores : mapping
        (scene, method, quantity) to scores, one row an experiment.
    asked : mapping
        (scene, method) to the number of experiments that the method was given.
    """
    judged: list[Line] = []
    for method in dict.fromkeys(method for _, method, _ in scores):
        own = {(scene, name): s for (scene, m, name), s in scores.items() if m == method}
        lines = [line_of(scene, method, name, s, asked[scene, method]) for (scene, name), s in own.items()]
        lines += _everywhere(method, own, asked)
        judged += judge(lines)
    return judged


def _everywhere(
    method: str, own: Mapping[tuple[str, str], Array], asked: Mapping[tuple[str, str], int]
) -> Iterable[Line]:
    """Quantities that occur in several scenes, pooled: small faults add up."""
    for name in dict.fromkeys(name for _, name in own):
        scenes = [scene for scene, other in own if other == name]
        if len(scenes) > 1:
            pooled = np.concatenate([own[scene, name] for scene in scenes])
            yield line_of(EVERYWHERE, method, name, pooled, sum(asked[scene, method] for scene in scenes))


def table_of(lines: Sequence[Line], *, ranks: bool) -> str:
    """Coverage, ranks and verdict of each line, as a table in Markdown."""
    shown = [i for i in range(len(LEVELS)) if any(not math.isnan(line.coverage[i]) for line in lines)]
    head = ("scene", "quantity", "n:", *(f"{100 * LEVELS[i]:.0f} %:" for i in shown))
    rows = []
    for line in lines:
        n = f"{line.n}" + (f" ({line.absent} without)" if line.absent else "")
        coverage = (f"{100 * line.coverage[i]:.1f} ± {100 * line.errors[i]:.1f}" for i in shown)
        p = (p_words(line.p_ranks),) if ranks else ()
        said = bold(line.verdict, when=not line.holds)
        rows.append((line.scene, line.name, n, *coverage, *p, p_words(line.adjusted), said))
    return markdown((*head, *(("p of ranks:",) if ranks else ()), "adjusted p:", "verdict"), rows)


def p_words(p: float) -> str:
    """Return a p value as tables show it."""
    if math.isnan(p):
        return "–"
    return f"{p:.3f}" if p >= 1e-3 else f"{p:.0e}" if p > 1e-99 else "< 1e-99"


def passes(lines: Iterable[Line], method: str) -> bool:
    """Whether a method is calibrated: every line of it holds."""
    own = [line for line in lines if line.method == method]
    return bool(own) and all(line.holds for line in own)
