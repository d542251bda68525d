"""Ways to draw an experiment anew from the one that was made: cases, residuals, wild weights."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.noise_identifiability import inputs_of_rows, n_parameters_seen

Array = NDArray[np.float64]

SCHEMES = {
    "cases": "impacts within each series",
    "residual": "residuals",
    "wild": "residuals times Rademacher weights",
    "wild-mammen": "residuals times Mammen weights",
}
FEWEST = 5  # to draw from; of fewer the sd comes out more than 10 % too small
_OWN = 1e-6  # 1 - leverage below which a row fits itself: it has no residual


@dataclass(frozen=True)
class ReplicateData:
    """Some replicates.

    Attributes
    ----------
    counts : ndarray, (m, n), or None
        How often each row occurs; None: once.
    shift : ndarray, (m, n), or None
        What is added to each value; None: nothing.
    prior : ndarray, (m, constants)
        Mean of the prior of each constant of the problem; nan where there is none.
    """

    counts: Array | None
    shift: Array | None
    prior: Array

    @property
    def size(self) -> int:
        """Number of replicates."""
        return int(self.prior.shape[0])

    def take(self, which: Index) -> ReplicateData:
        """Some of the replicates."""
        counts = None if self.counts is None else self.counts[which]
        return ReplicateData(counts, None if self.shift is None else self.shift[which], self.prior[which])


@dataclass(frozen=True, kw_only=True)
class Scheme(ABC):
    """Draws replicates, each from a generator of its own.

    Attributes
    ----------
    name : str
        As on the command line.
    prior : ndarray, (constants,)
        Where the means of priors are centred; nan where there is none.
    shortage : str
        What there is too little of to draw from, in words with the remedy; empty if there is enough.
    splits_impacts : bool
        Whether rows of one impact are drawn independently of one another.
    informs_noise : bool
        Whether replicates tell how uncertain the noise is.
    """

    name: str
    prior: Array
    shortage: str = ""
    splits_impacts: bool = False
    informs_noise: bool = True

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> tuple[Array | None, Array | None]:
        """Counts and shift of one replicate, each (n,) or None."""


def draw_replicates(
    problem: Problem, scheme: Scheme, seeds: Sequence[np.random.SeedSequence]
) -> ReplicateData:
    """One replicate a seed: so that it does not matter which are drawn together, or by whom.

    A prior is an auxiliary measurement: its mean is drawn anew from the normal law of its sd in each
    replicate, once for all series, or a constant that rests on it would seem to be known exactly.
    """
    counts, shifts, priors = [], [], []
    sd = np.array([math.nan if c.prior is None else c.prior[1] for c in problem.parameters])
    for seed in seeds:
        rng = np.random.default_rng(seed)
        count, shift = scheme.draw(rng)
        counts.append(count)
        shifts.append(shift)
        priors.append(scheme.prior + sd * rng.standard_normal(sd.size))
    return ReplicateData(_stacked(counts), _stacked(shifts), np.array(priors).reshape(len(seeds), -1))


def without_noise(problem: Problem, replicates: ReplicateData) -> NDArray[np.bool_]:
    """Which replicates have a noise that their rows cannot tell, as least squares would refuse them, (m,)."""
    refused = np.zeros(replicates.size, dtype=bool)
    if replicates.counts is None:
        return refused
    for rows in problem.noise_groups().values():
        inputs = inputs_of_rows(problem, rows)
        points = _different(inputs, replicates.counts[:, rows])
        few = points <= n_parameters_seen(problem, rows)
        if few.any():
            values = np.column_stack((inputs, problem.rows.value[rows]))
            refused |= few & (_different(values, replicates.counts[:, rows]) <= points)
    return refused


def _different(columns: Array, counts: Array) -> Index:
    """How many different rows there are among those that occur, in each replicate."""
    _, code = np.unique(columns, axis=0, return_inverse=True)
    code = code.reshape(-1)
    order = np.argsort(code, kind="stable")
    starts = np.flatnonzero(np.diff(code[order], prepend=-1))
    return np.asarray((np.add.reduceat(counts[:, order], starts, axis=1) > 0.0).sum(axis=1))


def _stacked(rows: list[Array | None]) -> Array | None:
    given = [row for row in rows if row is not None]
    return np.array(given) if given else None


def make_scheme(name: str, problem: Problem, found: LeastSquaresFit) -> Scheme:
    """Scheme of a name.

    Raises
    ------
    UsageError
        For a name that does not exist, and for priors of separate constants where values are drawn anew.
    """
    if name not in SCHEMES:
        raise UsageError(f"--resample {name}: choose one of {', '.join(SCHEMES)}.")
    if name == "cases":
        return Cases.of(problem)
    several = [c.name for c in problem.parameters if c.separate and c.prior is not None]
    if several and len(problem.series) > 1:
        raise UsageError(
            f"--resample {name} cannot draw one prior of {several[0]} anew for several series: use "
            "--resample cases."
        )
    return Residuals.of(problem, found) if name == "residual" else Wild.of(problem, found, name)


@dataclass(frozen=True, kw_only=True)
class Cases(Scheme):
    """Impacts drawn with replacement within each series, as many as there are: pairs, or cases, bootstrap.

    Impacts of a series that measure nothing in common, drop tests and oblique impacts say, are experiments of
    their own, and as many of each kind are drawn as were made. An impact brings all its rows along.

    References
    ----------
    Efron & Tibshirani (1993), An Introduction to the Bootstrap, chapters 8 and 9.
    """

    impact: Index
    kinds: tuple[Index, ...]

    @classmethod
    def of(cls, problem: Problem, impact: Index | None = None) -> Cases:
        """Cases of a problem; `impact` numbers them, by default the impacts."""
        own = number_impacts(problem) if impact is None else impact
        kinds = kinds_of(problem, own)
        splits = bool(np.unique(own).size > np.unique(number_impacts(problem)).size)
        return cls(
            name="cases",
            impact=own,
            kinds=tuple(kind.impacts for kind in kinds),
            prior=prior_means(problem),
            shortage=_few(kinds),
            splits_impacts=splits,
        )

    def draw(self, rng: np.random.Generator) -> tuple[Array, None]:
        """Draw each kind."""
        drawn = [members[rng.integers(members.size, size=members.size)] for members in self.kinds]
        count = np.bincount(np.concatenate(drawn), minlength=int(self.impact.max()) + 1)
        return count[self.impact].astype(float), None


def _few(kinds: Sequence[Kind]) -> str:
    few = [str(kind) for kind in kinds if kind.impacts.size < FEWEST]
    if not few:
        return ""
    return (
        f"{'; '.join(few)}. Drawn again and again they hide their scatter: use --resample residual, or "
        "give a constant that was measured once as --prior NAME=MEAN,SD"
    )


@dataclass(frozen=True, kw_only=True)
class Residuals(Scheme):
    """Fitted values plus residuals drawn with replacement, row by row, within rows of one noise.

    Residuals are taken over sigma and over sqrt(1 - leverage), then centred. One noise have all rows whose
    sigma is given (known or scaled), else those of one unknown noise. Rows of one impact are drawn
    apart, so errors that they share are lost.

    References
    ----------
    Davison & Hinkley (1997), Bootstrap Methods and their Application, section 6.2.3.
    """

    pools: tuple[tuple[Index, Array], ...]  # rows, and the residuals that they draw from
    base: Array = field(repr=False)  # fitted - value
    sigma: Array = field(repr=False)

    @classmethod
    def of(cls, problem: Problem, found: LeastSquaresFit) -> Residuals:
        """Residuals of a fit."""
        residual = corrected(problem, found) / found.sigma
        given = np.flatnonzero(problem.noise.is_given)
        groups: dict[str, Index] = {"all": np.arange(residual.size)}
        if problem.noise.has_unknown:
            groups = {**problem.noise_groups(), **({"rows with a given sigma": given} if given.size else {})}
        pools, few = [], []
        for name, rows in groups.items():
            own = residual[rows][1.0 - found.gaussian.leverage[rows] > _OWN]
            pools.append((rows, own - own.mean() if own.size else np.zeros(1)))
            if own.size < FEWEST:
                few.append(f"{own.size} in {name}")
        shortage = f"residuals, {'; '.join(few)}: use --method exact" if few else ""
        base = problem.predict(found.optimum.theta) - problem.rows.value
        splits = int(number_impacts(problem).max()) + 1 < residual.size
        return cls(
            name="residual",
            pools=tuple(pools),
            base=base,
            sigma=found.sigma,
            prior=fitted_means(problem, found),
            shortage=shortage,
            splits_impacts=splits,
        )

    def draw(self, rng: np.random.Generator) -> tuple[None, Array]:
        """Draw each pool."""
        shift = self.base.copy()
        for rows, pool in self.pools:
            shift[rows] += self.sigma[rows] * pool[rng.integers(pool.size, size=rows.size)]
        return None, shift


@dataclass(frozen=True, kw_only=True)
class Wild(Scheme):
    """Fitted values plus residuals over sqrt(1 - leverage), each impact's times one random weight.

    Rademacher: +1 or -1. Mammen: (1 -+ sqrt 5)/2 with probabilities (5 +- sqrt 5)/10, which keeps the third
    moment. Noise may differ from row to row, and rows of one impact keep the errors that they share.

    References
    ----------
    Liu (1988), Annals of Statistics 16, 1696; Mammen (1993), Annals of Statistics 21, 255.
    """

    impact: Index
    base: Array = field(repr=False)  # fitted - value
    residual: Array = field(repr=False)
    weights: tuple[float, float]
    chance: float  # of the first weight

    @classmethod
    def of(cls, problem: Problem, found: LeastSquaresFit, name: str = "wild") -> Wild:
        """Residuals of a fit, with the weights of a scheme."""
        root = math.sqrt(5.0)
        mammen = (0.5 * (1.0 - root), 0.5 * (1.0 + root)), (5.0 + root) / 10.0
        weights, chance = mammen if name == "wild-mammen" else ((-1.0, 1.0), 0.5)
        own = int((1.0 - found.gaussian.leverage <= _OWN).sum())
        shortage = (
            f"{own} row{'s' if own > 1 else ''} met exactly whatever the value, without a residual to weigh: "
            "use --method exact"
        )
        return cls(
            name=name,
            impact=number_impacts(problem),
            base=problem.predict(found.optimum.theta) - problem.rows.value,
            residual=corrected(problem, found),
            weights=weights,
            chance=chance,
            prior=fitted_means(problem, found),
            shortage=shortage if own else "",
            informs_noise=False,
        )

    def draw(self, rng: np.random.Generator) -> tuple[None, Array]:
        """Draw the weights."""
        first = rng.random(int(self.impact.max()) + 1) < self.chance
        return None, self.base + np.where(first, *self.weights)[self.impact] * self.residual


def corrected(problem: Problem, found: LeastSquaresFit) -> Array:
    """Residuals over sqrt(1 - leverage), with the variance of their noise; 0 where a row fits itself."""
    raw = problem.residual(found.optimum.theta)
    left = 1.0 - found.gaussian.leverage
    return np.asarray(np.where(left > _OWN, raw / np.sqrt(np.maximum(left, _OWN)), 0.0))


def prior_means(problem: Problem) -> Array:
    """Means of the priors as given, one a constant; nan where there is none."""
    return np.array([math.nan if c.prior is None else c.prior[0] for c in problem.parameters])


def fitted_means(problem: Problem, found: LeastSquaresFit) -> Array:
    """Constants of the fit where they have a prior: what is drawn anew lies about the fit, as values do."""
    places = problem.parameters.positions
    return np.array(
        [math.nan if c.prior is None else found.optimum.theta[places[c.name][0]] for c in problem.parameters]
    )


@dataclass(frozen=True)
class Kind:
    """Impacts of one series that measure the same things.

    Attributes
    ----------
    series : str
    observables : tuple of str
    impacts : ndarray of int
    """

    series: str
    observables: tuple[str, ...]
    impacts: Index

    def __str__(self) -> str:
        n = self.impacts.size
        return f"{n} impact{'' if n == 1 else 's'} with {', '.join(self.observables)} in {self.series}"


def number_impacts(problem: Problem) -> Index:
    """Impact of each row; a row without an impact_id is an impact of its own."""
    return Density(problem).impact


def kinds_of(problem: Problem, impact: Index) -> list[Kind]:
    """Sort impacts by series, and within it by what they measure.

    Impacts that share an observable are of one kind, and so are those that a third one links: a missing cell
    makes no kind of its own. An impact with rows in several series counts to that of its first row.
    """
    rows = problem.rows
    first = np.unique(impact, return_index=True)[1]
    series = rows.series[first]
    measures = np.zeros((first.size, len(rows.names)), dtype=bool)
    measures[impact, rows.which] = True
    kinds = []
    for number, name in enumerate(problem.series):
        left = np.flatnonzero(series == number)
        while left.size:
            seen = measures[left[0]]
            while True:
                linked = (measures[left] & seen).any(axis=1)
                wider = measures[left[linked]].any(axis=0)
                if (wider == seen).all():
                    break
                seen = wider
            observables = tuple(n for n, is_seen in zip(rows.names, seen, strict=True) if is_seen)
            kinds.append(Kind(name, observables, left[linked]))
            left = left[~linked]
    return kinds
