"""Few rows and constants of each series: importance sampling of all of them together, and series by series.

    python benchmarks/separate_constants.py             # 62 tables, some minutes; --quick: 12 tables

A table has 3 to 5 series of 3 to 6 rows for each of one or two observables; mu, the closure's own constant or
both are separate. Tables that the exact posterior leaves to quadrature are not counted.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
from _common import benchmark_parser, publish, verdict

from ifrfit.errors import IfrfitError
from ifrfit.inference.fit import make_question
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.options import Model, Noise
from ifrfit.inference.posterior import exact_posterior
from ifrfit.inference.posterior.factorised_sampling import sample_by_series
from ifrfit.inference.posterior.importance_posterior import ImportancePosterior
from ifrfit.inference.posterior.importance_sampling import sample_by_importance
from ifrfit.physics import OBSERVABLES, get_closure, rebound

INERTIA_FACTOR = 0.4
SAMPLERS = {"all together": sample_by_importance, "series by series": sample_by_series}
LEAST = 0.8  # share of the tables that is to converge


def draw(number: int, path: Path) -> Problem:
    """A table at random, written to a file, and the question that is asked of it."""
    rng = np.random.default_rng([7, number])
    n_series = int(rng.integers(3, 6))
    closure = get_closure(str(rng.choice(["ifr", "ifr", "ifr", "fr", "f", "ifr-contact"])))
    count = 1 if rng.uniform() < 0.7 else 2
    names = rng.choice(["beta", "psi_after_deg", "delta_deg", "v_x", "mu_app"], count, replace=False)
    e_n = rng.uniform(0.6, 0.98)
    lines = ["series,observable,gamma_deg,value,sigma"]
    states_sigma = rng.uniform() < 0.4
    mu = 0.05 * 10.0 ** rng.uniform(0.0, 1.0)
    low = high = c = 0.0
    if closure.constant:
        low, high = closure.domain(INERTIA_FACTOR)
        high = min(high, low + 2.0)
        c = rng.uniform(low, high)
    each = int(rng.integers(3, 7))
    differs = rng.uniform() < 0.5
    for series in range(n_series):
        friction = mu * (2.0 ** rng.uniform(-1.0, 1.0) if differs else 1.0)
        own = {}
        if closure.constant:
            own = {closure.constant: float(np.clip(c + (0.1 * rng.normal() if differs else 0.0), low, high))}
        n = each if rng.uniform() < 0.5 else int(rng.integers(3, 7))
        for name in names:
            gamma = np.sort(rng.uniform(3.0, 80.0, n))
            state = rebound(
                gamma, e_n=e_n, mu=friction, closure=closure.name, degrees=True,
                inertia_factor=INERTIA_FACTOR, **own,
            )  # fmt: skip
            value = np.broadcast_to(OBSERVABLES[str(name)].value(state, np.asarray(friction)), gamma.shape)
            size = 10.0 ** rng.uniform(-2.5, -1.0) * max(float(np.nanstd(value)), 0.1)
            value = value + size * rng.standard_normal(n)
            sigma = f"{size:.3g}" if states_sigma else ""
            lines += [f"s{series},{name},{g:.3f},{v:.6g},{sigma}" for g, v in zip(gamma, value, strict=True)]
    if closure.constant is None or rng.uniform() < 0.4:
        separate = ["mu"]
    else:
        separate = [closure.constant, "mu"] if rng.uniform() < 0.75 else [closure.constant]
    noise = str(rng.choice(["known", "scaled", "unknown"])) if states_sigma else "unknown"
    if noise == "unknown" and rng.uniform() < 0.25:
        separate.append("noise")
    way = rng.uniform()
    fix = {"e_n": round(e_n, 3)} if way < 0.45 else {}
    prior = {"e_n": (round(e_n, 3), 0.02)} if 0.45 <= way < 0.75 else {}
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    model = Model(closure.name, fix=fix, prior=prior, separate=tuple(separate))
    question = make_question(path, model, Noise(noise), 0, None, {})
    return question.problem(closure, model.parameters(question.inertia_factor))


def measure(number: int, path: Path) -> dict[str, object] | None:
    """Both samplers on one table; None where it has no answer, or quadrature gives it."""
    try:
        problem = draw(number, path)
        start = least_squares(problem)
    except IfrfitError:  # an unknown noise of no more rows than constants
        return None
    if not isinstance(exact_posterior(problem, start=start), ImportancePosterior):
        return None
    row: dict[str, object] = {"table": number, "constants": len(problem.free_parameters)}
    for name, sample in SAMPLERS.items():
        began = time.process_time()
        found = sample(problem, start)
        row |= {
            f"{name} s": time.process_time() - began,
            f"{name} converged": found.converged,
            f"{name} error": found.error,
            f"{name} error_evidence": found.error_evidence,
            f"{name} log_evidence": found.log_evidence,
        }
    return row


def main() -> None:
    """Run the benchmark."""
    parser = benchmark_parser(__doc__, quick="12 tables")
    parser.add_argument("--tables", type=int, default=62)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        numbers = range(12 if options.quick else options.tables)
        found = [measure(number, Path(name) / "table.csv") for number in numbers]
    rows = [row for row in found if row is not None]
    table = [["", "converged", "CPU, median", "most", "error, median", "most", "of log evidence, most"]]
    for name in SAMPLERS:
        columns = {
            key: np.array([float(row[f"{name} {key}"]) for row in rows])  # type: ignore[arg-type]
            for key in ("s", "converged", "error", "error_evidence")
        }
        table.append([
            name, f"{columns['converged'].sum():.0f} of {len(rows)}",
            *(f"{np.quantile(columns['s'], q):.1f} s" for q in (0.5, 1.0)),
            *(f"{np.quantile(columns['error'], q):.2f} sd" for q in (0.5, 1.0)),
            f"{columns['error_evidence'].max():.2f}",
        ])  # fmt: skip
    share = np.mean([bool(row["series by series converged"]) for row in rows])
    goal = f"{100 * LEAST:.0f} % converge series by series: {verdict(bool(share >= LEAST))}"
    publish(options, "separate constants", rows, table, [goal])


if __name__ == "__main__":
    main()
