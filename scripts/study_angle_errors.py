"""What errors of the angle do to a fit, and what each treatment makes of them; writes docs/angle-errors.md.

``python scripts/study_angle_errors.py [--repeats 200] [--calibrate 200] [--workers N] [--seed S]``

One experiment whose angles err is fitted in four ways, over and over with new errors. Exit status 1 if the
exact posterior is not calibrated under a scatter that it is told.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain

# first: it sets the number of threads
from studies import bold, in_order, markdown, publish, render, study_parser, versions

# isort: split
import numpy as np
from calibration_methods import EXACT
from calibration_scenes import SCATTERED
from calibration_study import Study, gather, run_many, tasks_of
from calibration_verdict import FAMILY, table_of
from simulated import simulated

from ifrfit.inference.model.apply_error_model import with_error_model
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import make_problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import integrate
from ifrfit.physics import rebound
from ifrfit.physics.closures import get_closure

SEED = 20260514
TRUTH = {"e_n": 0.9, "e_t": -0.85, "mu": 0.15}
ASKED = ("e_t", "mu")
ANGLES = (8.0, 78.0)  # degrees, between which true angles lie
N = 24
SIGMA, SIGMA_GAMMA = 0.05, 3.0  # of beta; of the angle, degrees
TOLERANCE = 1e-2
LEVEL = 0.95
KINDS = ("set", "measured")
SEEN = 3.0  # standard errors beyond which a bias or a miscoverage is called one
TREATMENTS = {
    "none": ErrorModel(),
    "effective": ErrorModel(angles="effective", gamma=SIGMA_GAMMA),
    "set": ErrorModel(angles="set", gamma=SIGMA_GAMMA),
    "measured": ErrorModel(angles="measured", population=ANGLES, gamma=SIGMA_GAMMA),
}


@dataclass(frozen=True)
class Found:
    """What one treatment says of one experiment: mean, sd, and whether the 95 % interval holds the truth."""

    kind: str
    treatment: str
    mean: tuple[float, ...]
    sd: tuple[float, ...]
    covers: tuple[bool, ...]


@dataclass(frozen=True)
class Summary:
    """One constant under one treatment: bias and its standard error, spread, stated sd, share covered."""

    kind: str
    treatment: str
    constant: str
    n: int
    bias: float
    error: float
    spread: float
    stated: float
    coverage: float

    @property
    def coverage_error(self) -> float:
        """Binomial standard error of a coverage of 95 %."""
        return math.sqrt(LEVEL * (1.0 - LEVEL) / self.n)


def treat(task: tuple[int, str, int]) -> list[Found]:
    """Simulate one experiment (seed, kind of angles, number) and fit it in every way."""
    seed, kind, number = task
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(KINDS.index(kind), number)))
    if kind == "set":
        shown = np.linspace(*ANGLES, N)
        true = shown + SIGMA_GAMMA * rng.standard_normal(N)
    else:
        true = rng.uniform(*ANGLES, N)
        shown = true + SIGMA_GAMMA * rng.standard_normal(N)
    beta = rebound(np.abs(true), **TRUTH, degrees=True).beta + SIGMA * rng.standard_normal(N)
    closure = get_closure("ifr")
    constants = make_parameters(closure, 0.4, fix={"e_n": TRUTH["e_n"]})
    plain = make_problem(simulated("beta", np.abs(shown), beta, SIGMA), closure, 0.4, constants, "known")
    found = []
    for name, error_model in TREATMENTS.items():
        problem = with_error_model(plain, error_model)
        post = integrate(problem, tolerance=TOLERANCE, start=least_squares(problem))
        inside = []
        for constant in ASKED:
            low, high = np.asarray(post.quantile(constant, np.array([0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])))
            inside.append(bool(low <= TRUTH[constant] <= high))
        means, sds = (tuple(float(of(c)) for c in ASKED) for of in (post.mean, post.sd))
        found.append(Found(kind, name, means, sds, tuple(inside)))
    return found


def summarise(results: Iterable[Found]) -> list[Summary]:
    """Bias and coverage of each constant, by kind of angles and treatment."""
    groups: dict[tuple[str, str], list[Found]] = {}
    for one in results:
        groups.setdefault((one.kind, one.treatment), []).append(one)
    found = []
    for (kind, treatment), own in groups.items():
        for i, constant in enumerate(ASKED):
            off = np.array([one.mean[i] for one in own]) - TRUTH[constant]
            spread = float(off.std(ddof=1))
            found.append(
                Summary(
                    kind,
                    treatment,
                    constant,
                    len(own),
                    float(off.mean()),
                    spread / math.sqrt(len(own)),
                    spread,
                    float(np.mean([one.sd[i] for one in own])),
                    float(np.mean([one.covers[i] for one in own])),
                )
            )
    return found


def page(
    treated: Sequence[Summary], study: Study, seed: int, repeats: int, calibrated: int
) -> tuple[str, list[str]]:
    """Return the page, and what went wrong: scatter under which the exact posterior is not calibrated."""
    wrong = study.faults(EXACT)
    text = render(
        "angle_errors.md",
        seed=seed,
        versions=versions(),
        n=N,
        sigma=SIGMA,
        ends=ANGLES,
        sigma_gamma=SIGMA_GAMMA,
        truth=", ".join(f"{name} = {value:g}" for name, value in TRUTH.items()),
        repeats=repeats,
        level=f"{100 * LEVEL:g}",
        seen=SEEN,
        tables={kind: _treatments([one for one in treated if one.kind == kind]) for kind in KINDS},
        calibrated=calibrated,
        family=f"{FAMILY:g}",
        scenes=[SCATTERED[name] for name in study.errors],
        result="Not as it must be: " + "; ".join(wrong) if wrong else "Calibrated under every scatter",
        lines=table_of([line for line in study.lines if line.method == EXACT], ranks=True),
    )
    return text, wrong


def _treatments(own: Sequence[Summary]) -> str:
    rows = []
    for one in own:
        biased = abs(one.bias) > SEEN * one.error
        missed = abs(one.coverage - LEVEL) > SEEN * one.coverage_error
        bias = bold(f"{one.bias:+.4f} ± {one.error:.4f}", when=biased)
        covered = bold(f"{100 * one.coverage:.1f} ± {100 * one.coverage_error:.1f} %", when=missed)
        rows.append((one.treatment, one.constant, bias, f"{one.spread:.4f}", f"{one.stated:.4f}", covered))
    head = ("treatment", "constant", "bias:", "spread of means:", "stated sd:", "in the 95 % interval:")
    return markdown(head, rows)


def main() -> int:
    """Run both parts; exit status 1 if a calibration fails."""
    parser = study_parser(__doc__, SEED, "angle-errors.md")
    parser.add_argument("--repeats", type=int, default=200, help="experiments of each kind of angle")
    parser.add_argument("--calibrate", type=int, default=200, help="experiments of each scatter")
    chosen = parser.parse_args()
    seed, repeats = chosen.seed, chosen.repeats
    experiments = [(seed, kind, number) for kind in KINDS for number in range(repeats)]
    treated = summarise(chain.from_iterable(in_order(treat, experiments, chosen.workers)))
    tasks = tasks_of(seed, chosen.calibrate, 0, 0, peers=False, scenes=tuple(SCATTERED))
    study = gather(run_many(tasks, chosen.workers))
    text, wrong = page(treated, study, seed, repeats, chosen.calibrate)
    return publish(chosen.out / "angle-errors.md", text, wrong, "exact is calibrated under every scatter")


if __name__ == "__main__":
    sys.exit(main())
