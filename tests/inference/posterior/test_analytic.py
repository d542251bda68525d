"""Posteriors that are known in closed form, or as one integral, to 1e-8."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf
from posterior_agreement import check, normal, uniform
from posterior_questions import LEVELS, Question, Row, measured

from ifrfit.inference.posterior import integrate

STRICT = 1e-8
SHARE = 2.0 / 7.0
STEEP = (4.0, 7.0, 10.0, 12.0, 14.0)
FLAT = (55.0, 62.0, 68.0, 73.0, 78.0, 81.0)


def truncated(centre: float, sd: float, low: float, high: float) -> tuple[float, dict[str, Any]]:
    """Log of the mass of a normal law between its bounds, and that law cut off there."""
    with mp.workdps(40):
        centre_, sd_, x, y = mpf(centre), mpf(sd), (mpf(low) - centre) / sd, (mpf(high) - centre) / sd
        far = x > 0  # keep the digits of the tail in which the bounds lie
        mass = mp.ncdf(-x) - mp.ncdf(-y) if far else mp.ncdf(y) - mp.ncdf(x)
        first = (mp.npdf(x) - mp.npdf(y)) / mass
        second = 1 + (x * mp.npdf(x) - y * mp.npdf(y)) / mass

        def quantile(p: float) -> float:
            def excess(u: Any) -> Any:
                below = mp.ncdf(-x) - mp.ncdf(-u) if far else mp.ncdf(u) - mp.ncdf(x)
                return below / mass - p

            return float(centre_ + sd_ * bisect(excess, max(x, mpf(-30)), min(y, max(x, mpf(-30)) + 60)))

        law = {
            "mean": float(centre_ + sd_ * first),
            "sd": float(sd_ * mp.sqrt(second - first**2)),
            "quantiles": [quantile(p) for p in LEVELS],
        }
        return float(mp.log(mass)), law


def bisect(f: Callable[[Any], Any], low: Any, high: Any, turns: int = 60) -> Any:
    """Root of a rising function."""
    for _ in range(turns):
        middle = (low + high) / 2
        low, high = (middle, high) if f(middle) < 0 else (low, middle)
    return (low + high) / 2


def scaled(law: dict[str, Any], factor: float) -> dict[str, Any]:
    """The law of a multiple."""
    return {
        "mean": factor * law["mean"],
        "sd": factor * law["sd"],
    } | ({"quantiles": [factor * x for x in law["quantiles"]]} if "quantiles" in law else {})


def log_normal_rows(residual: np.ndarray, sigma: np.ndarray) -> float:
    """Log likelihood of independent residuals."""
    return float(-0.5 * ((residual / sigma) ** 2).sum() - np.log(sigma * math.sqrt(2.0 * math.pi)).sum())


def columns(rows: Sequence[Row]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slip ratio without spin, value, sigma."""
    return (
        np.tan(np.radians([r.gamma for r in rows])),
        np.array([r.value for r in rows]),
        np.array([r.sigma for r in rows]),
    )


# --- sticking only


@pytest.mark.parametrize("level", [0.55, 0.40, 0.37, 0.30, 1.02])
def test_sticking_only_where_mu_cannot_reach_sliding(level: float) -> None:
    e_n, low, high = 0.9, 0.2, 0.7  # (5/2) 0.2 1.9 = 0.95 > tan 14 degrees
    noise = np.array([0.03, -0.02, 0.01, 0.04, -0.05])
    rows = tuple(
        Row("beta", g, round(level + float(x), 4), s)
        for g, x, s in zip(STEEP, noise, (0.02, 0.03, 0.05, 0.02, 0.04), strict=True)
    )
    post = integrate(Question(rows, fix={"e_n": e_n}, bounds={"mu": (low, high)}).problem(), tolerance=1e-9)
    _, value, sigma = columns(rows)
    weight = sigma**-2
    centre = float((weight * (value - 1.4)).sum() / weight.sum())
    sd = float(weight.sum() ** -0.5)
    log_mass, e_t = truncated(centre, sd, -1.0, -0.4)
    log_z = log_normal_rows(value - 1.4 - centre, sigma) + math.log(sd * math.sqrt(2.0 * math.pi) / 0.6)
    known = {
        "log_evidence": log_z + log_mass,
        "quantities": {
            "e_t": e_t,
            "mu": uniform(low, high),
            "kappa": scaled(uniform(low, high), 1.0 + e_n),
        },
    }
    check(post, known, STRICT)


@pytest.mark.parametrize("e_t_true", [-0.95, -0.75])
def test_sticking_at_one_angle_with_mu_free(e_t_true: float) -> None:
    # below kappa = (2/5) tau it slides, beta = e_t + (7/2) kappa/tau; above it sticks, and kappa is free
    e_n, gamma, sigma = 0.8, 10.0, 0.06
    value = round(e_t_true + 1.4 + 0.02, 4)
    question = Question((Row("beta", gamma, value, sigma),), fix={"e_n": e_n})
    post = integrate(question.problem(), tolerance=1e-9)
    with mp.workdps(30):
        tau = mp.tan(mp.radians(mpf(gamma)))
        kink, top = mpf("0.4") * tau, 2 * (1 + mpf(e_n))
        low, high, s, v = mpf(-1), mpf("-0.4"), mpf(sigma), mpf(value)

        def lift(k: Any) -> Any:
            return min(mpf("3.5") * k / tau, mpf("1.4"))

        def mass(k: Any) -> Any:
            centre = v - lift(k)
            return mp.ncdf((high - centre) / s) - mp.ncdf((low - centre) / s)

        def integral(f: Callable[[Any], Any], upto: Any = top) -> Any:
            inner = mp.quad(f, mp.linspace(0, min(upto, kink), 4), method="gauss-legendre")
            return inner + (mp.quad(f, [kink, upto], method="gauss-legendre") if upto > kink else 0)

        z = integral(mass)
        mean = integral(lambda k: k * mass(k)) / z
        square = integral(lambda k: k * k * mass(k)) / z
        kappa = {"mean": float(mean), "sd": float(mp.sqrt(square - mean**2))}
        for p in LEVELS:
            assert abs(integral(mass, mpf(float(post.quantile("kappa", p)))) / z - p) < STRICT

        def moment(k: Any, order: int) -> Any:
            centre = v - lift(k)
            x, y = (low - centre) / s, (high - centre) / s
            first = centre * mass(k) + s * (mp.npdf(x) - mp.npdf(y))
            if order == 1:
                return first
            spread = mass(k) + x * mp.npdf(x) - y * mp.npdf(y)
            return centre**2 * mass(k) + 2 * centre * s * (mp.npdf(x) - mp.npdf(y)) + s**2 * spread

        first, second = (integral(lambda k, m=m: moment(k, m)) / z for m in (1, 2))
        e_t = {"mean": float(first), "sd": float(mp.sqrt(second - first**2))}
        log_z = float(mp.log(z / ((high - low) * top)))  # the normal law in c is normalised as it stands
    known = {
        "log_evidence": log_z,
        "quantities": {"e_t": e_t, "mu": scaled(kappa, 1.0 / (1.0 + e_n)), "kappa": kappa},
    }
    check(post, known, STRICT)


# --- sliding only


def sliding_law(rows: Sequence[Row]) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean and covariance of (e_t, kappa), and the log of the likelihood's integral over both."""
    tau, value, sigma = columns(rows)
    design = np.column_stack([np.ones_like(tau), 3.5 / tau]) / sigma[:, None]
    precision = design.T @ design
    centre = np.linalg.solve(precision, design.T @ (value / sigma))
    residual = value - centre[0] - 3.5 * centre[1] / tau
    log_z = log_normal_rows(residual, sigma) + math.log(2.0 * math.pi) - 0.5 * np.linalg.slogdet(precision)[1]
    return centre, np.linalg.inv(precision), float(log_z)


def marginals(centre: np.ndarray, covariance: np.ndarray) -> tuple[dict[str, Any], ...]:
    """The normal law of each of (e_t, kappa)."""
    return tuple(map(normal, centre.tolist(), np.sqrt(np.diag(covariance)).tolist()))


def test_sliding_only_is_jointly_normal() -> None:
    rows = measured("beta", FLAT, seed=3, sigma=0.004, e_n=0.9, c=-0.7, mu=0.15)
    centre, covariance, log_z = sliding_law(rows)
    e_t, kappa = marginals(centre, covariance)
    post = integrate(Question(rows, fix={"e_n": 0.9}).problem(), tolerance=1e-9)
    known = {
        "log_evidence": log_z - math.log(0.6) - math.log(2.0 * 1.9),
        "quantities": {"e_t": e_t, "mu": scaled(kappa, 1.0 / 1.9), "kappa": kappa},
    }
    check(post, known, STRICT)
    draws = post.draws(20_000, np.random.default_rng(1))
    expected = covariance[0, 1] / math.sqrt(covariance[0, 0] * covariance[1, 1])
    found = np.corrcoef(draws["e_t"], draws["kappa"])[0, 1]
    assert abs(found - expected) < 5.0 * (1.0 - expected**2) / math.sqrt(20_000)


def test_beta_alone_leaves_e_n_to_the_prior_of_mu() -> None:
    # mu = kappa/(1 + e_n) is uniform, so that e_n has the density 1/((1 + e_n) log 2), kappa whatever it be
    rows = measured("beta", FLAT, seed=4, sigma=0.004, e_n=0.9, c=-0.7, mu=0.15)
    centre, covariance, log_z = sliding_law(rows)
    e_t, kappa = marginals(centre, covariance)
    two = math.log(2.0)
    e_mean, e_square = 1.0 / two - 1.0, 1.0 - 0.5 / two
    inverse, inverse_square = 0.5 / two, 0.375 / two  # of 1 + e_n
    kappa_square = kappa["mean"] ** 2 + kappa["sd"] ** 2
    mu_mean = kappa["mean"] * inverse
    known = {
        "log_evidence": log_z - math.log(0.6) - math.log(2.0) + math.log(two),
        "quantities": {
            "e_n": {
                "mean": e_mean,
                "sd": math.sqrt(e_square - e_mean**2),
                "quantiles": [2.0**p - 1.0 for p in LEVELS],
            },
            "e_t": e_t,
            "mu": {"mean": mu_mean, "sd": math.sqrt(kappa_square * inverse_square - mu_mean**2)},
            "kappa": kappa,
        },
    }
    check(integrate(Question(rows).problem(), tolerance=1e-9), known, STRICT)


# --- constants measured directly


@pytest.mark.parametrize("value", [0.8, 0.97, 1.0, 1.06, 0.01])
def test_e_n_alone_is_a_truncated_normal_and_the_rest_is_prior(value: float) -> None:
    rows = (Row("e_n", math.nan, value, 0.03), Row("e_n", math.nan, value - 0.01, 0.02))
    weight = np.array([0.03, 0.02]) ** -2
    values = np.array([value, value - 0.01])
    centre, sd = float((weight * values).sum() / weight.sum()), float(weight.sum() ** -0.5)
    log_mass, e_n = truncated(centre, sd, 0.0, 1.0)
    log_z = log_normal_rows(values - centre, weight**-0.5) + math.log(sd * math.sqrt(2.0 * math.pi))
    mean, square = 1.0 + e_n["mean"], e_n["sd"] ** 2 + (1.0 + e_n["mean"]) ** 2
    known = {
        "log_evidence": log_z + log_mass,
        "quantities": {
            "e_n": e_n,
            "e_t": uniform(-1.0, -0.4),
            "mu": uniform(0.0, 2.0),
            "kappa": {"mean": mean, "sd": math.sqrt(square * 4.0 / 3.0 - mean**2)},
        },
    }
    check(integrate(Question(rows).problem(), tolerance=1e-9), known, STRICT)


def test_e_n_alone_with_the_rest_fixed() -> None:
    rows = (Row("e_n", math.nan, 0.8, 0.03),)
    log_mass, e_n = truncated(0.8, 0.03, 0.0, 1.0)
    question = Question(rows, fix={"e_t": -0.9, "mu": 0.2})
    kappa = {
        "mean": 0.2 * (1.0 + e_n["mean"]),
        "sd": 0.2 * e_n["sd"],
        "quantiles": [0.2 * (1.0 + x) for x in e_n["quantiles"]],
    }
    known = {"log_evidence": log_mass, "quantities": {"e_n": e_n, "kappa": kappa}}
    check(integrate(question.problem(), tolerance=1e-9), known, STRICT)


def test_mu_alone_is_a_truncated_normal() -> None:
    rows = (Row("mu", math.nan, 0.02, 0.03),)
    log_mass, mu = truncated(0.02, 0.03, 0.0, 2.0)
    question = Question(rows, fix={"e_n": 0.5}, closure="f")
    known = {"log_evidence": log_mass - math.log(2.0), "quantities": {"mu": mu, "kappa": scaled(mu, 1.5)}}
    check(integrate(question.problem(), tolerance=1e-9), known, STRICT)


def test_a_gaussian_prior_and_no_other_word_on_a_constant() -> None:
    rows = measured("beta", FLAT, seed=5, sigma=0.004, e_n=0.9, c=-0.7, mu=0.15)
    centre, covariance, log_z = sliding_law(rows)
    log_prior, _ = truncated(0.97, 0.05, 0.0, 1.0)
    question = Question(rows, prior={"e_n": (0.97, 0.05), "e_t": (-0.72, 0.01)}, fix={"mu": 0.15})
    post = integrate(question.problem(), tolerance=1e-9)
    # kappa = 0.15 (1 + e_n) is a third word on the normal law of (e_t, kappa)
    precision = np.linalg.inv(covariance) + np.diag([1e4, (0.15 * 0.05) ** -2])
    target = np.linalg.inv(covariance) @ centre + np.array([-0.72e4, 0.15 * 1.97 * (0.15 * 0.05) ** -2])
    joint = np.linalg.inv(precision)
    best = joint @ target
    sd = joint[1, 1] ** 0.5
    log_inside, kappa = truncated(float(best[1]), float(sd), 0.15, 0.3)
    assert set(post.names) == {"e_n", "e_t", "kappa"}
    for p, x in zip(LEVELS, kappa["quantiles"], strict=True):
        assert abs(post.quantile("kappa", p) - x) <= STRICT * sd
        assert abs(post.quantile("e_n", p) - (x / 0.15 - 1.0)) <= STRICT * sd / 0.15
    assert abs(post.mean("kappa") - kappa["mean"]) <= STRICT * sd
    assert abs(post.sd("kappa") / kappa["sd"] - 1.0) <= STRICT
    prior = np.diag([1e-4, (0.15 * 0.05) ** 2])
    apart = centre - np.array([-0.72, 0.15 * 1.97])
    log_z -= 0.5 * float(apart @ np.linalg.solve(covariance + prior, apart))
    log_z -= 0.5 * np.linalg.slogdet(covariance + prior)[1] + math.log(2.0 * math.pi)
    assert abs(post.log_evidence - (log_z + log_inside - log_prior)) <= STRICT


# --- unknown noise


class Student:
    """e_n measured several times with one unknown sigma: everything as one-dimensional integrals."""

    def __init__(self, values: Sequence[float], low: float, high: float, weights: Sequence[float]) -> None:
        self.n = len(values)
        self.low, self.high = mpf(low), mpf(high)
        w = [1 / mpf(s) ** 2 for s in weights]
        self.log_norm = mp.fsum(mp.log(x) for x in w) / 2 - self.n * mp.log(2 * mp.pi) / 2
        v = [mpf(x) for x in values]
        self.weight = mp.fsum(w)
        self.mean = mp.fsum(a * b for a, b in zip(w, v, strict=True)) / self.weight
        self.rest = mp.fsum(a * (b - self.mean) ** 2 for a, b in zip(w, v, strict=True))
        self.spread = mp.sqrt(self.rest / (self.n - 1) / self.weight)
        reach = [0, 1, 2, 3, 5, 8, 13, 25, 60, 150]
        inside = [self.mean + sign * x * self.spread for x in reach for sign in (-1, 1)]
        self.breaks = sorted({mpf(0), mpf(1), *(x for x in inside if 0 < x < 1)})
        self.z = self.over_e(lambda e: self.sigma_moment(e, 0))

    def sigma_moment(self, e: Any, power: int, upto: Any = None) -> Any:
        """Integral of sigma^(power - 1 - n) exp(-S/(2 sigma^2))."""
        half = (self.rest + self.weight * (e - self.mean) ** 2) / 2
        n = mpf(self.n - power) / 2
        top = self.high if upto is None else upto
        return half ** (-n) * mp.gammainc(n, half / top**2, half / self.low**2) / 2

    def over_e(self, f: Callable[[Any], Any], upto: Any = None) -> Any:
        breaks = self.breaks if upto is None else [*(x for x in self.breaks if x < upto), upto]
        return mp.quad(f, breaks, method="gauss-legendre", maxdegree=4) if len(breaks) > 1 else mpf(0)

    def known(self, noise: str) -> dict[str, Any]:
        mean, square = (self.over_e(lambda e, m=m: e**m * self.sigma_moment(e, 0)) / self.z for m in (1, 2))
        s_mean, s_square = (self.over_e(lambda e, m=m: self.sigma_moment(e, m)) / self.z for m in (1, 2))
        return {
            "log_evidence": float(self.log_norm + mp.log(self.z / mp.log(self.high / self.low))),
            "quantities": {
                "e_n": {"mean": float(mean), "sd": float(mp.sqrt(square - mean**2))},
                noise: {"mean": float(s_mean), "sd": float(mp.sqrt(s_square - s_mean**2))},
            },
        }

    def cdf_e(self, x: float) -> float:
        return float(self.over_e(lambda e: self.sigma_moment(e, 0), mpf(x)) / self.z)

    def cdf_noise(self, x: float) -> float:
        return float(self.over_e(lambda e: self.sigma_moment(e, 0, mpf(x))) / self.z)


@pytest.mark.long
@pytest.mark.parametrize(
    ("values", "low", "high"),
    [
        ((0.81, 0.84, 0.79, 0.83, 0.80, 0.86), 1e-4, 1.0),
        ((0.97, 0.99, 0.98, 1.0), 1e-3, 0.3),  # on its bound, with heavy tails
        ((0.70, 0.72, 0.69), 0.01, 0.05),  # bounds that cut the law of sigma off
    ],
)
@pytest.mark.parametrize("policy", ["unknown", "scaled"])
def test_e_n_alone_with_unknown_noise(
    values: tuple[float, ...], low: float, high: float, policy: str
) -> None:
    sigmas = [0.5 * (1 + i % 3) for i in range(len(values))] if policy == "scaled" else [1.0] * len(values)
    rows = tuple(
        Row("e_n", math.nan, v, s if policy == "scaled" else None)
        for v, s in zip(values, sigmas, strict=True)
    )
    name = "noise" if policy == "scaled" else "noise[run/e_n]"
    question = Question(
        rows,
        fix={"e_t": -0.9, "mu": 0.2},
        noise=policy,
        noise_bounds={"" if policy == "scaled" else "run/e_n": (low, high)},
    )
    post = integrate(question.problem(), tolerance=1e-9)
    with mp.workdps(25):
        student = Student(values, low, high, sigmas)
        known = student.known(name)
        e_n = known["quantities"]["e_n"]
        known["quantities"]["kappa"] = {"mean": 0.2 * (1.0 + e_n["mean"]), "sd": 0.2 * e_n["sd"]}
        check(post, known, STRICT)
        for p in (0.025, 0.5, 0.84):
            assert abs(student.cdf_e(float(post.quantile("e_n", p))) - p) <= STRICT
            assert abs(student.cdf_noise(float(post.quantile(name, p))) - p) <= STRICT
