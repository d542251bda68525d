"""Random tables over the whole space of questions: CPU seconds, memory and errors, worst first.

    python benchmarks/strangers.py                      # 200 tables, an hour or more; --quick: 20 tables
    python benchmarks/strangers.py --seed 0 --only 17   # one table again, with its CSV and its commands

A table has 10 to 300 rows, 1 to 5 series, up to 10 groups of noise, any observables, any closure (the one
that made it or another), sigma stated for all rows, for none, or for some observables or series alone, each
policy of the noise that such a table allows, constants that the series share or not, e_n fixed, known before
or open. Each command runs in a process of its own, start of the interpreter included.

The same seed and number give the same table, as long as `draw` stays as it is: since it draws tables with
sigma in part, and --noise=mixed, those of a number are others than in the pages written before.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from _common import benchmark_parser, publish, verdict
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import logsumexp
from scipy.stats import multivariate_t

from ifrfit.errors import IfrfitError
from ifrfit.inference.estimators import Exact
from ifrfit.inference.fit import make_question
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.options import Model, Noise
from ifrfit.physics import CLOSURES, OBSERVABLES, get_closure, rebound

Array = NDArray[np.float64]

ROWS = (10, 300)
SERIES = 5
GROUPS = 10
INERTIA_FACTOR = 0.4
HEADER = "series,observable,gamma_deg,spin_x,spin_y,value,sigma"
LIMIT = 120  # seconds after which a command counts as one that did not end
MEMORY_LIMIT = 6 * 2**30  # bytes of address space, so that a runaway does not take the machine down
GIB = 2**30
POLICIES = {  # by the rows whose sigma is stated
    "all": ("known", "scaled", "unknown", "mixed"),
    "none": ("unknown", "mixed"),
    "some": ("mixed", "mixed", "unknown"),
}
GOALS = {"fit": 2.0, "compare": 10.0, "fit --out": 5.0}  # CPU seconds
LEAST_DRAWS = 400.0  # effective draws below which importance sampling is no reference


@dataclass(frozen=True)
class Stranger:
    """A table and the question that is asked of it.

    Attributes
    ----------
    seed : tuple of int
    text : str
        The CSV.
    closure : str
        That is fitted.
    made_by : str
        The closure that made the values.
    fix, prior, separate, noise
        As the keywords of `ifrfit.fit`.
    rows, series, groups : int
        Its size.
    contradicts : bool
        Whether the series have a friction each.
    sigma : str
        For which rows sigma is stated: "all", "none", or "observables" or "series", for some of them.
    """

    seed: tuple[int, int]
    text: str
    closure: str
    made_by: str
    fix: Mapping[str, float]
    prior: Mapping[str, tuple[float, float]]
    separate: tuple[str, ...]
    noise: str
    rows: int
    series: int
    groups: int
    contradicts: bool
    sigma: str

    @property
    def options(self) -> list[str]:
        """Of the command line, without the closure."""
        fixed = [f"--fix={name}={value:g}" for name, value in self.fix.items()]
        known = [f"--prior={name}={mean:g},{sd:g}" for name, (mean, sd) in self.prior.items()]
        return [*fixed, *known, *(f"--separate={name}" for name in self.separate), f"--noise={self.noise}"]

    @property
    def says(self) -> str:
        """In a line."""
        return f"{self.closure} on {self.made_by}; sigma of {self.sigma}; {' '.join(self.options)}"

    def problem(self, path: Path) -> Problem:
        """The question in memory, of the table written to a file."""
        model = Model(self.closure, fix=self.fix, prior=self.prior, separate=self.separate)
        question = make_question(path, model, Noise(self.noise), 0, None, {})
        return question.problem(get_closure(self.closure), model.parameters(question.inertia_factor))


def draw(seed: int, number: int) -> Stranger:
    """A table at random; the same for the same seed and number."""
    rng = np.random.default_rng([seed, number])
    n_series = int(rng.integers(1, SERIES + 1))
    most = max(1, GROUPS // n_series)
    names = rng.choice(list(OBSERVABLES), int(rng.integers(1, min(most, 4) + 1)), replace=False)
    made_by = str(rng.choice(list(CLOSURES)))
    closure = made_by if rng.uniform() < 0.7 else str(rng.choice(list(CLOSURES)))
    e_n = rng.uniform(0.6, 0.98)
    mu = 0.05 * 10.0 ** rng.uniform(0.0, 1.0)
    entry = get_closure(made_by)
    own: dict[str, float] = {}
    if entry.constant is not None:
        low, high = entry.domain(INERTIA_FACTOR)
        own = {entry.constant: float(rng.uniform(low, min(high, low + 2.0)))}
    n_rows = round(10.0 ** rng.uniform(*np.log10(ROWS)))
    n_each = max(1, n_rows // (n_series * names.size))
    contradicts = n_series > 1 and bool(rng.uniform() < 0.3)
    stated = _stated(rng, n_series, names.size)
    spins = bool(rng.uniform() < 0.4)
    lines = [HEADER]
    for number_of_series in range(n_series):
        friction = mu * (2.0 ** rng.uniform(-1.0, 1.0) if contradicts else 1.0)
        for which, name in enumerate(names):
            gamma = np.sort(rng.uniform(2.0, 86.0, n_each))
            spin_x = rng.normal(0.0, 0.5, n_each) if spins else np.zeros(n_each)
            spin_y = rng.normal(0.0, 0.3, n_each) if spins else np.zeros(n_each)
            state = rebound(
                gamma, spin_x, spin_y, e_n=e_n, mu=friction, closure=made_by, degrees=True,
                inertia_factor=INERTIA_FACTOR, **own,
            )  # fmt: skip
            value = np.broadcast_to(OBSERVABLES[str(name)].value(state, np.asarray(friction)), gamma.shape)
            size = 10.0 ** rng.uniform(-2.5, -1.0) * max(float(np.nanstd(value)), 0.1)
            value = value + size * rng.standard_normal(n_each)
            sigma = f"{size:.3g}" if stated.of[number_of_series, which] else ""
            lines += [
                f"s{number_of_series},{name},{g:.3f},{x:.4f},{y:.4f},{v:.6g},{sigma}"
                for g, x, y, v in zip(gamma, spin_x, spin_y, value, strict=True)
            ]
    policy = str(rng.choice(POLICIES[stated.words if stated.words in POLICIES else "some"]))
    separate = [name for name in ("mu",) if n_series > 1 and rng.uniform() < 0.25]
    if policy in ("unknown", "mixed") and n_series > 1 and rng.uniform() < 0.3:
        separate.append("noise")
    way = rng.uniform()
    return Stranger(
        seed=(seed, number),
        text="\n".join(lines) + "\n",
        closure=closure,
        made_by=made_by,
        fix={"e_n": round(e_n, 3)} if way < 0.3 else {},
        prior={"e_n": (round(e_n, 3), 0.02)} if 0.3 <= way < 0.6 else {},
        separate=tuple(separate),
        noise=policy,
        rows=len(lines) - 1,
        series=n_series,
        groups=n_series * names.size,
        contradicts=contradicts,
        sigma=stated.words,
    )


@dataclass(frozen=True)
class _Stated:
    """For which groups of rows sigma is stated: in words, and for each series and observable."""

    words: str
    of: NDArray[np.bool_]


def _stated(rng: np.random.Generator, n_series: int, n_observables: int) -> _Stated:
    """Sigma of all rows in four tables of ten, of none in three, else of some observables or series."""
    shape = (n_series, n_observables)
    way, by_series = rng.uniform(), bool(rng.uniform() < 0.5)
    several = [word for word, n in zip(("series", "observables"), shape, strict=True) if n > 1]
    if way < 0.4 or (way < 0.7 and not several):
        return _Stated("all", np.ones(shape, dtype=bool))
    if way >= 0.7:
        return _Stated("none", np.zeros(shape, dtype=bool))
    word = several[0] if by_series else several[-1]
    n = n_series if word == "series" else n_observables
    own = rng.permutation(n) < int(rng.integers(1, n))
    return _Stated(word, np.broadcast_to(own[:, None] if word == "series" else own, shape))


@dataclass(frozen=True)
class Run:
    """What a command took.

    Attributes
    ----------
    exit : int or None
        None where it did not end in time.
    cpu : float
        Seconds.
    memory : float
        Most that was resident, GiB.
    text : str
        What it printed, errors after it.
    """

    exit: int | None
    cpu: float
    memory: float
    text: str


def _limits() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))


def run(command: Sequence[str], folder: Path) -> Run:
    """Run a command of ifrfit in a process of its own, and measure the process."""
    with (folder / "printed").open("w+", encoding="utf-8") as printed:
        process = subprocess.Popen(
            [sys.executable, "-m", "ifrfit", *command],
            cwd=folder, stdout=printed, stderr=subprocess.STDOUT, preexec_fn=_limits,
        )  # fmt: skip
        end = time.monotonic() + LIMIT
        ended = False
        while not ended and time.monotonic() < end:
            time.sleep(0.01)
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            ended = pid != 0
        if not ended:
            process.kill()
            _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        printed.seek(0)
        text = printed.read()
    cpu = usage.ru_utime + usage.ru_stime
    return Run(process.returncode if ended else None, cpu, usage.ru_maxrss * 1024 / GIB, text)


def commands(table: Stranger) -> dict[str, list[str]]:
    """What a user would type, by the name of its goal."""
    fit = ["fit", "table.csv", f"--closure={table.closure}", *table.options]
    return {
        "fit": fit,
        "compare": ["compare", "table.csv", *table.options],
        "fit --out": [*fit, "--out=report", "--force"],
    }


@dataclass(frozen=True)
class Errors:
    """How far answers are from references of their own.

    Attributes
    ----------
    proven : bool
        Whether the optimum claims a proof.
    missed : float
        By how much -2 log L of the optimum lies above the best of the local searches.
    mean : float
        Largest error of a constant's mean, in posterior sd, against importance sampling; nan without one.
    sd : float
        Largest relative error of a constant's sd, likewise.
    draws : float
        Effective draws behind the reference.
    """

    proven: bool
    missed: float
    mean: float
    sd: float
    draws: float


def _minus_twice_log_likelihood(problem: Problem) -> Callable[[Array], float]:
    """With every unknown noise at its best, and the priors; the constant parts left out."""
    groups = list(problem.noise_groups().values())
    base, known = problem.noise.base, problem.noise.is_given

    def of(theta: Array) -> float:
        z = (problem.rows.value - problem.predict(theta)) / base
        prior = problem.parameters.prior_residuals(theta)
        squares = [r.size * np.log(max(float(np.mean(z[r] ** 2)), 1e-300)) for r in groups]
        return float(sum(squares) + z[known] @ z[known] + prior @ prior)

    return of


def errors_of(problem: Problem, searches: int = 10, draws: int = 20_000) -> Errors:
    """Hold least squares against local searches, and the exact posterior against importance sampling.

    The proposal is a mixture of t distributions (5 degrees of freedom): one with the moments of the answer,
    wider by a half, and one about each place where the local searches ended within 20 of the best, so that a
    mode which the answer lacks shows as an error and not as agreement.
    """
    rng = np.random.default_rng(0)
    found = least_squares(problem)
    objective = _minus_twice_log_likelihood(problem)
    free = problem.parameters.free
    low, high = problem.parameters.bounds()
    low, high = low[free], np.minimum(high[free], 2.0)
    ends = []
    for _ in range(searches):
        at = found.optimum.theta.copy()

        def of(x: Array, at: Array = at) -> float:
            at[free] = np.clip(x, low, high)
            return objective(at)

        start = low + (high - low) * rng.uniform(size=low.size)
        ended = minimize(of, start, method="Nelder-Mead", options={"maxiter": 200 * low.size})
        at[free] = np.clip(ended.x, low, high)
        ends.append((float(ended.fun), at))
    best = min(value for value, _ in ends)
    missed = objective(found.optimum.theta) - best
    density = Density(problem)
    answer = Exact().run(problem, found, seed=0).distribution
    if answer is None:
        return Errors(found.optimum.certified, missed, np.nan, np.nan, 0.0)
    points = density.points(answer.draws(4000, rng))
    covariance = np.atleast_2d(np.cov(points, rowvar=False)) + 1e-12 * np.eye(points.shape[1])
    centres = [points.mean(axis=0)]
    for value, theta in ends:
        if value - best < 20.0:
            residual = (problem.rows.value - problem.predict(theta)) / problem.noise.base
            noises = [np.log(np.std(residual[r]) + 1e-12) for r in problem.noise_groups().values()]
            centres.append(np.concatenate((theta[free], noises)))
    laws = [multivariate_t(centre, 2.25 * covariance, df=5, seed=rng) for centre in centres]
    shares = np.array([0.7, *[0.3 / max(len(laws) - 1, 1)] * (len(laws) - 1)])
    shares /= shares.sum()
    counts = rng.multinomial(draws, shares)
    sample = np.concatenate(
        [np.reshape(law.rvs(int(n)), (int(n), -1)) for law, n in zip(laws, counts, strict=True) if n]
    )
    parts = [law.logpdf(sample) + np.log(share) for law, share in zip(laws, shares, strict=True)]
    proposal = logsumexp(parts, axis=0)
    weights = np.concatenate([density(part) for part in np.array_split(sample, 20)]) - proposal
    weights = np.exp(weights - logsumexp(weights))
    effective = float(1.0 / np.sum(weights**2))
    if effective < LEAST_DRAWS:
        return Errors(found.optimum.certified, missed, np.nan, np.nan, effective)
    n = len(density.unknowns)
    mean = weights @ sample[:, :n]
    sd = np.sqrt(weights @ (sample[:, :n] - mean) ** 2)
    names = density.names[:n]
    own_mean = np.array([answer.mean(name) for name in names])
    own_sd = np.array([answer.sd(name) for name in names])
    return Errors(
        found.optimum.certified,
        missed,
        float(np.max(np.abs(own_mean - mean) / sd, initial=0.0)),
        float(np.max(np.abs(own_sd / sd - 1.0), initial=0.0)),
        effective,
    )


def measure(table: Stranger, folder: Path, *, reference: bool) -> dict[str, object]:
    """One row of the results."""
    (folder / "table.csv").write_text(table.text, encoding="utf-8")
    row: dict[str, object] = {
        "table": table.seed[1], "rows": table.rows, "series": table.series, "groups": table.groups,
        "contradicts": table.contradicts, "question": table.says,
    }  # fmt: skip
    for name, command in commands(table).items():
        done = run(command, folder)
        row |= {f"{name} exit": done.exit, f"{name} cpu": done.cpu, f"{name} gib": done.memory}
        last = done.text.strip().splitlines()[-1:] if done.exit not in (0, 4) else []
        row[f"{name} says"] = last[0][:200] if last else ""
        if name == "fit":
            row["several modes"] = "several sets of constants" in done.text.lower()
            row["converged"] = "not converged" not in done.text.lower()
    nothing = {"proven": None, "missed": np.nan, "mean": np.nan, "sd": np.nan, "draws": 0.0}
    if reference and row["fit exit"] == 0:
        try:
            row |= vars(errors_of(table.problem(folder / "table.csv")))
        except IfrfitError as error:
            row |= nothing | {"fit says": str(error)}
    else:
        row |= nothing
    return row


def summary(rows: Sequence[Mapping[str, object]]) -> tuple[list[list[str]], list[str]]:
    """The table of distributions, and the goals."""
    table = [["", "median", "90 %", "most", "over the goal", "memory, most", "failed"]]
    goals = []
    for name, goal in GOALS.items():
        cpu = np.array([float(row[f"{name} cpu"]) for row in rows])  # type: ignore[arg-type]
        memory = max(float(row[f"{name} gib"]) for row in rows)  # type: ignore[arg-type]
        failed = sum(row[f"{name} exit"] not in (0, 2, 4) for row in rows)
        over = int((cpu > goal).sum())
        table.append(
            [name, *(f"{np.quantile(cpu, q):.2f} s" for q in (0.5, 0.9, 1.0)), f"{over} of {len(rows)}",
             f"{memory:.2f} GiB", str(failed)]
        )  # fmt: skip
        goals.append(f"{name}: {goal:g} s of CPU and 1 GiB: {verdict(over == 0 and memory <= 1.0)}")
    held = [row for row in rows if row["proven"] is not None]
    if held:
        false = sum(bool(row["proven"]) and float(row["missed"]) > 0.05 for row in held)  # type: ignore[arg-type]
        goals.append(f"no search goes below a proven optimum ({len(held)} tables): {verdict(false == 0)}")
        errors = np.array([float(row["mean"]) for row in held])  # type: ignore[arg-type]
        known = errors[np.isfinite(errors)]
        if known.size:
            goals.append(
                f"means within 0.1 sd of importance sampling ({known.size} tables; largest "
                f"{known.max():.3f}): {verdict(bool(known.max() < 0.1))}"
            )
    return table, goals


def main() -> None:
    """Run the benchmark."""
    parser = benchmark_parser(__doc__, quick="20 tables")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tables", type=int, default=200)
    parser.add_argument("--only", type=int, help="this table alone; prints its CSV and its commands")
    parser.add_argument("--no-reference", action="store_true", help="seconds and memory only")
    options = parser.parse_args()
    numbers = range(20 if options.quick else options.tables) if options.only is None else [options.only]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for number in numbers:
            table = draw(options.seed, number)
            row = measure(table, Path(name), reference=not options.no_reference)
            rows.append(row)
            seconds = "  ".join(f"{each} {row[f'{each} cpu']:.2f}" for each in GOALS)
            size = f"{number:3d}  {table.rows:3d} rows  {table.groups:2d} groups"
            print(f"{size}  {seconds}  {table.says}", flush=True)
            if options.only is not None:
                print(table.text, *(f"ifrfit {' '.join(c)}\n" for c in commands(table).values()), sep="\n")
                print(*(f"{key}: {value}" for key, value in row.items()), sep="\n")
                return
    worst = sorted(rows, key=lambda row: -max(float(row[f"{n} cpu"]) / g for n, g in GOALS.items()))  # type: ignore[arg-type]
    print("\nworst first")
    for row in worst[:10]:
        print("  ".join(f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}"
                        for key, value in row.items() if value not in ("", None)))  # fmt: skip
    table_rows, goals = summary(rows)
    publish(options, "strangers", worst, table_rows, goals)


if __name__ == "__main__":
    main()
