"""The five fits of the posterior benchmark: as our problem, and as arrays for a model written by hand."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from _common import benchmark_parser
from scipy.special import ndtr, ndtri

import ifrfit
from ifrfit.data.observations import Observations, make_table
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.physics.closures import get_closure

Array = np.ndarray

J = 0.4
SHARE = J / (1.0 + J)
E_N, E_T, MU = 0.9, -0.9, 0.15
SIGMA_BETA, SIGMA_E_N, SIGMA_DELTA = 0.05, 0.02, 2.0
E_N_DOMAIN, E_T_DOMAIN, MU_DOMAIN = (0.0, 1.0), (-1.0, -J), (0.0, 2.0)
NOISE_DOMAIN = (1e-3, 1.0)  # of both unknown sigmas, log-uniform
E_N_PRIOR = (0.9, 0.02)
SEED = 20240607


@dataclass(frozen=True, eq=False)
class Scene:
    """One fit.

    `cot`, `tan`, `series` and `value` describe the tangential rows (beta, or delta in degrees), `e_n` holds
    the values of e_n. theta is e_n, e_t, mu of each series, then the logarithms of unknown sigmas.
    """

    key: str
    title: str
    observable: str
    observations: Observations
    problem: Problem
    fit_options: Mapping[str, object]
    cot: Array
    tan: Array
    series: Array
    value: Array
    e_n: Array
    sigma: float
    unknown_noise: bool

    @property
    def n_series(self) -> int:
        return len(self.problem.series)

    @property
    def constants(self) -> tuple[str, ...]:
        """What errors are measured on, by our names."""
        return ("e_n", "e_t", *(name for name in self.problem.parameters.names if name.startswith("mu")))

    @property
    def dimensions(self) -> int:
        return 2 + self.n_series + (2 if self.unknown_noise else 0)

    @property
    def domain(self) -> tuple[Array, Array]:
        """Lower and upper ends of theta."""
        noise = [tuple(np.log(NOISE_DOMAIN))] * (2 if self.unknown_noise else 0)
        ends = np.array([E_N_DOMAIN, E_T_DOMAIN, *[MU_DOMAIN] * self.n_series, *noise])
        return ends[:, 0], ends[:, 1]

    def start(self) -> Array:
        """theta of the least squares, where any sampler would be started."""
        found = ifrfit.inference.optimize.least_squares.least_squares(self.problem)
        noise = [self.sigma, SIGMA_E_N] if self.unknown_noise else []
        return np.concatenate((found.optimum.theta, np.log(noise)))

    def model(self, e_n: Array, e_t: Array, mu: Array) -> Array:
        """Tangential values; the arguments broadcast against the rows."""
        impulse = np.minimum(J, mu * (1.0 + e_n) * self.cot)
        if self.observable == "beta":
            return e_t + impulse / SHARE
        k = SHARE * (1.0 + e_t) + impulse
        return np.degrees(np.arctan((1.0 - k) * self.tan / e_n))

    def log_likelihood(self) -> Callable[[Array], Array]:
        """A lean log-likelihood of theta in the last axis: e_n enters by its mean and scatter."""
        n = self.e_n.size
        mean = float(self.e_n.mean()) if n else 0.0
        scatter = float(((self.e_n - mean) ** 2).sum()) if n else 0.0
        several, rows = self.n_series > 1, self.series + 2

        def of(theta: Array) -> Array:
            e_n, e_t = theta[..., 0:1], theta[..., 1:2]
            mu = theta[..., rows] if several else theta[..., 2:3]
            square = ((self.value - self.model(e_n, e_t, mu)) ** 2).sum(axis=-1)
            square_e_n = scatter + n * (theta[..., 0] - mean) ** 2
            if not self.unknown_noise:
                return -0.5 * (square / self.sigma**2 + square_e_n / SIGMA_E_N**2)
            log_s, log_s_e_n = theta[..., -2], theta[..., -1]
            chi2 = square * np.exp(-2.0 * log_s) + square_e_n * np.exp(-2.0 * log_s_e_n)
            return -0.5 * chi2 - self.value.size * log_s - n * log_s_e_n

        return of

    def log_prior(self, theta: Array) -> Array:
        """Logarithm of the prior up to a constant; -inf outside the domain."""
        lower, upper = self.domain
        inside = ((theta >= lower) & (theta <= upper)).all(axis=-1)
        gauss = 0.0 if self.e_n.size else -0.5 * ((theta[..., 0] - E_N_PRIOR[0]) / E_N_PRIOR[1]) ** 2
        return np.where(inside, gauss, -np.inf)

    def from_unit_cube(self, cube: Array) -> Array:
        """theta of a point of the unit cube under the prior."""
        lower, upper = self.domain
        theta = lower + cube * (upper - lower)
        if not self.e_n.size:
            mean, sd = E_N_PRIOR
            below, above = ndtr((lower[0] - mean) / sd), ndtr((upper[0] - mean) / sd)
            theta[..., 0] = mean + sd * ndtri(below + cube[..., 0] * (above - below))
        return theta

    def residual(self, theta: Array) -> Array:
        """Standardised residuals of a single theta, the prior's last: what lmfit is handed."""
        mu = theta[self.series + 2] if self.n_series > 1 else theta[2]
        tangential = (self.value - self.model(theta[0], theta[1], mu)) / self.sigma
        if not self.e_n.size:
            return np.append(tangential, (theta[0] - E_N_PRIOR[0]) / E_N_PRIOR[1])
        return np.concatenate((tangential, (self.e_n - theta[0]) / SIGMA_E_N))


def scene_options(description: str | None, quick: str = "") -> argparse.Namespace:
    """Options of a benchmark on scenes; `only` is the list of those that are asked for."""
    parser = benchmark_parser(description, quick)
    parser.add_argument("--only", default=",".join(TITLES), help="scenes, as in i,ii")
    options = parser.parse_args()
    options.only = options.only.split(",")
    if unknown := [key for key in options.only if key not in TITLES]:
        parser.error(f"no scene {', '.join(unknown)}; there are {', '.join(TITLES)}")
    return options


def make_scene(key: str) -> Scene:
    """One of `TITLES`; the tangents are worked out here, off every clock."""
    table, options = {
        "i": lambda: _beta_and_e_n(1, 40),
        "ii": lambda: _beta_and_e_n(1, 40),  # the same data
        "iii": lambda: _beta_and_e_n(3, 500),
        "iv": lambda: _beta_and_e_n(4, 20, np.linspace(0.1, 0.25, 10)),
        "v": _delta,
    }[key]()
    closure, unknown_noise = get_closure("ifr"), key == "ii"
    observations = Observations(table)
    noise = "unknown" if unknown_noise else "known"
    problem = make_problem(observations, closure, J, make_parameters(closure, J, **options), noise)
    if unknown_noise:
        problem = problem.with_noise(problem.noise.with_bounds(dict.fromkeys(problem.groups(), NOISE_DOMAIN)))
    tangential = table[table["observable"] != "e_n"]
    tan = np.tan(np.radians(tangential["gamma_deg"].to_numpy()))
    return Scene(
        key=key,
        title=TITLES[key],
        observable=tangential["observable"].iloc[0],
        observations=observations,
        problem=problem,
        fit_options={**options, "noise": noise},
        cot=1.0 / tan,
        tan=tan,
        series=pd.factorize(tangential["series"])[0],
        value=tangential["value"].to_numpy(),
        e_n=table.loc[table["observable"] == "e_n", "value"].to_numpy(),
        sigma=tangential["sigma"].iloc[0],
        unknown_noise=unknown_noise,
    )


TITLES = {
    "i": "80 points of beta and e_n, known noise",
    "ii": "80 points of beta and e_n, unknown noise",
    "iii": "1,000 points of beta and e_n, known noise",
    "iv": "10 series of 40 points of beta and e_n, separate mu",
    "v": "80 points of delta, prior on e_n",
}
Made = tuple[pd.DataFrame, dict[str, object]]  # a table, and the options of its fit


def _beta_and_e_n(number: int, n: int, mu: Array | None = None) -> Made:
    """n values of beta and n of e_n in each series."""
    rng = np.random.default_rng([SEED, number])
    mus = np.array([MU]) if mu is None else mu
    gamma = np.tile(np.linspace(5.0, 85.0, n), mus.size)
    series = np.repeat(np.arange(mus.size), n)
    exact = ifrfit.rebound(gamma, e_n=E_N, e_t=E_T, mu=mus[series], degrees=True).beta
    beta = exact + rng.normal(0.0, SIGMA_BETA, gamma.size)
    e_n = E_N + rng.normal(0.0, SIGMA_E_N, gamma.size)
    table = make_table(
        {
            "series": [f"run {s}" for s in series] * 2,
            "observable": np.repeat(["beta", "e_n"], gamma.size),
            "gamma_deg": np.tile(gamma, 2),
            "value": np.concatenate((beta, e_n)),
            "sigma": np.repeat([SIGMA_BETA, SIGMA_E_N], gamma.size),
        }
    )
    return table, {} if mu is None else {"separate": ("mu",)}


def _delta() -> Made:
    """80 values of delta; e_n is known beforehand."""
    rng = np.random.default_rng([SEED, 5])
    gamma = np.linspace(5.0, 85.0, 80)
    exact = np.degrees(ifrfit.rebound(gamma, e_n=E_N, e_t=E_T, mu=MU, degrees=True).delta)
    delta = exact + rng.normal(0.0, SIGMA_DELTA, gamma.size)
    columns = {"series": "run 0", "observable": "delta_deg", "gamma_deg": gamma, "value": delta}
    return make_table({**columns, "sigma": SIGMA_DELTA}), {"prior": {"e_n": E_N_PRIOR}}
