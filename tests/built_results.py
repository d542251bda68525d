"""Results built by hand, so that reports are tested without an estimator."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from ifrfit.data import Descriptor, Source
from ifrfit.data.observations import make_table
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Correlation, Estimate, Fact, FitStatistics, NoiseSummary, State
from ifrfit.physics import OBSERVABLES, get_closure, rebound, transition_angles, transition_tau

IFR = get_closure("ifr")


def estimate(value: float | None, sd: float | None, status: Any = "determined", reason: str = "") -> Estimate:
    """A Gaussian estimate."""
    if value is None or sd is None:
        middle = value if value is not None else 0.0
        return Estimate(value, sd, (middle, middle), (middle, middle), status, reason)
    return Estimate(
        value, sd, (value - sd, value + sd), (value - 1.96 * sd, value + 1.96 * sd), status, reason
    )


class StubResult(FitResult):
    """A result whose bands come from a few seeded draws, not from the estimator's own code."""

    def predict(  # type: ignore[no-untyped-def]
        self, gamma, spin_x=0.0, spin_y=0.0, *, observable="beta", series=None, degrees=True, bands=True
    ):
        rng = np.random.default_rng(1)
        center, sd = self.state.center, np.sqrt(np.diag(self.state.covariance))
        names = [name.partition("[")[0] for name in self.state.names]
        own = [i for i, name in enumerate(self.state.names) if "[" not in name or f"[{series}]" in name]
        draws = {
            names[i]: np.clip(
                center[i] + sd[i] * rng.standard_normal(200), self.state.lower[i], self.state.upper[i]
            )
            for i in own
        }
        e_n, e_t, kappa = (draws[name][:, None] for name in ("e_n", "e_t", "kappa"))
        grid, mu = np.atleast_1d(gamma)[None, :], kappa / (1.0 + e_n)
        state = rebound(grid, spin_x, spin_y, e_n=e_n, e_t=e_t, mu=mu, degrees=degrees)
        values = OBSERVABLES[observable].value(state, mu)
        table = {"gamma_deg": grid[0], "value": np.median(values, axis=0)}
        for level, low, high in (("68", 16.0, 84.0), ("95", 2.5, 97.5)):
            table[f"lo{level}"], table[f"hi{level}"] = np.percentile(values, [low, high], axis=0)
        return pd.DataFrame(table)


@dataclass(frozen=True)
class Run:
    """One series to make up."""

    name: str
    n: int = 34
    spin_y: float = 0.0
    spin_x: float = 0.0
    gamma: tuple[float, float] = (3.0, 82.0)
    provenance: str = "measured"
    sigma_gamma: float = float("nan")
    mu: float = float("nan")


TRUTH = {"e_n": 0.94, "e_t": -0.98, "mu": 0.12}
NOISE = {"delta_deg": 1.5, "mu_app": 0.01, "e_n": 0.02, "mu": 0.01}


def points_of(
    runs: tuple[Run, ...], observables: tuple[str, ...], source: str, truth: dict[str, float], seed: int = 3
) -> pd.DataFrame:
    """Points with noise around the law, and all the columns of a result."""
    rng = np.random.default_rng(seed)
    parts = []
    for run in runs:
        own = truth if np.isnan(run.mu) else {**truth, "mu": run.mu}
        gamma = np.linspace(*run.gamma, run.n) if run.n > 1 else np.array([40.0])
        state = rebound(gamma, run.spin_x, run.spin_y, degrees=True, **own)  # type: ignore[arg-type]
        for name in observables:
            angled = OBSERVABLES[name].has_angle
            fitted = OBSERVABLES[name].value(state, np.asarray(own["mu"]))
            sigma = NOISE.get(name, 0.05)
            z = rng.standard_normal(run.n)
            part = make_table(
                {
                    "series": run.name,
                    "observable": name,
                    "gamma_deg": gamma if angled else np.full(run.n, np.nan),
                    "spin_x": np.full(run.n, run.spin_x),
                    "spin_y": np.full(run.n, run.spin_y),
                    "value": fitted + sigma * z,
                    "sigma_gamma_deg": np.full(run.n, run.sigma_gamma if angled else np.nan),
                    "impact_id": [f"{run.name}-{i}" for i in range(run.n)] if len(observables) > 1 else "",
                    "provenance": run.provenance,
                    "source": source,
                }
            )
            part["sigma_used"], part["fitted"] = sigma, fitted
            part["residual"], part["standardised"] = sigma * z, z
            part["tau"], part["sticking"] = state.incidence.tau, state.sticking
            parts.append(part)
    return pd.concat(parts, ignore_index=True)


def transition_of(run: Run, kappa: float) -> Estimate | tuple[Estimate, ...] | None:
    """The transition angles of a series, with a made-up uncertainty."""
    kappa = kappa if np.isnan(run.mu) else run.mu * 1.94
    angles = transition_angles(transition_tau(IFR, -0.98, kappa), run.spin_x, run.spin_y)
    found = tuple(estimate(angle, 0.8) for angle in angles)
    return found[0] if len(found) == 1 else found or None


def facts() -> dict[str, Fact]:
    """Facts of a fit that is fine."""
    return {
        "global_optimum": Fact(
            True, "Global optimum certified, the only one.", {"gap": 0.0, "n_optima": 1}, "gap <= 1e-9"
        ),
        "lack_of_fit": Fact(True, "No lack of fit (p = 0.42).", {"p": 0.42}, "p >= 0.001"),
        "outliers": Fact(True, "No outliers.", {"rows": [], "limit": 3.6}, "Bonferroni at 1 %"),
    }


def build(
    runs: tuple[Run, ...] = (Run("run 1"),),
    observables: tuple[str, ...] = ("beta",),
    *,
    name: str = "impacts.csv",
    descriptor: Descriptor | None = None,
    truth: dict[str, float] | None = None,
    **changes: Any,
) -> StubResult:
    """A result that looks like one of a least-squares fit with e_n fixed."""
    values = {**TRUTH, **(truth or {})}
    points = points_of(runs, observables, name, values)
    kappa = values["mu"] * (1.0 + values["e_n"])
    sticking = int(points["sticking"].sum())
    provenance = ", ".join(dict.fromkeys(run.provenance for run in runs))
    point = np.array([values["e_n"], values["e_t"], kappa])
    source = Source(
        name, "ab" * 32, len(points) + 2, len(points), {"not measured": 2}, provenance, "", descriptor
    )
    content: dict[str, Any] = {
        "closure": "ifr",
        "inertia_factor": 0.4,
        "method": "lsq",
        "inputs": (source,),
        "noise": NoiseSummary(
            "unknown", {f"{run.name}/{o}": NOISE.get(o, 0.05) for run in runs for o in observables}
        ),
        "constants": {
            "e_n": estimate(values["e_n"], None, "fixed"),
            "e_t": Estimate(
                values["e_t"],
                0.0131,
                (-0.993, -0.967),
                (-1.0, -0.957),
                "one_sided",
                "lies on its bound -1",
            ),
            "mu": estimate(values["mu"], 0.0041),
        },
        "derived": {
            "kappa": estimate(kappa, 0.008),
            "transition_angle_deg": {run.name: transition_of(run, kappa) for run in runs},
            "beta_sticking": estimate(values["e_t"] + 1.4, 0.0131),
        },
        "correlation": Correlation(("e_t", "mu"), np.array([[1.0, -0.68], [-0.68, 1.0]])),
        "fit": FitStatistics(
            len(points),
            len(points) - sticking,
            sticking,
            2,
            0.0,
            31.2,
            32,
            0.975,
            0.51,
            0.05,
            50.1,
            -96.0,
            -92.0,
        ),
        "facts": facts(),
        "warnings": (
            "beta cannot tell e_n from mu: mu scales with 1/(1 + 0.94). "
            "Measure e_n (one drop test) to free it.",
        ),
        "state": State(
            ("e_n", "e_t", "kappa"),
            point,
            point,
            np.diag([0.0, 0.0131**2, 0.008**2]),
            np.array([0.0, -1.0, 0.0]),
            np.array([1.0, -0.4, np.inf]),
        ),
        "points": points,
        "seed": 0,
        "command": "ifrfit fit impacts.csv --fix e_n=0.94",
        "created": "2026-01-02T03:04:05Z",
        "versions": {"ifrfit": "0.1.0", "python": "3.11.9", "numpy": "2.0.0"},
    }
    return StubResult(**{**content, **changes})


CROSS = Descriptor(
    "cross-2019",
    "Steel ball on granite",
    "stand-in",
    {"material": "steel", "wall": "granite", "diameter_mm": 12.0},
    ("beta",),
    (),
    "known",
    (("no spin", "no spin, centre"),),
    0.4,
    ("34 points a series",),
    {"e_n": 0.94, "e_t": -0.98, "mu": 0.12},
    "CC-BY-4.0",
    "a paper's printed constants",
)


def fine() -> StubResult:
    """One series, one unknown noise, everything well."""
    return build()


def stand_in() -> StubResult:
    """Three series of a stand-in; at the largest spin nothing sticks. Sigma is known."""
    runs = (
        Run("no spin", 17, provenance="stand-in"),
        Run("spin 0.225", 17, 0.225, provenance="stand-in"),
        Run("spin 0.833", 17, 0.833, provenance="stand-in"),
    )
    sigma = {f"{run.name}/beta": 0.05 for run in runs}
    return build(runs, name="cross-2019", descriptor=CROSS, noise=NoiseSummary("known", sigma))


def two_observables() -> StubResult:
    """Two series, two observables of the same impacts, given sigma scaled, digitised."""
    runs = (
        Run("first reading", 20, provenance="digitised", sigma_gamma=0.8),
        Run("second reading", 20, provenance="digitised"),
    )
    result = build(runs, ("beta_cm", "delta_deg"))
    points = result.points
    points["sigma"] = points["sigma_used"] / 1.8
    keys = {f"{s}/{o}": 0.05 for s, o in points[["series", "observable"]].drop_duplicates().to_numpy()}
    return replace(result, points=points, noise=NoiseSummary("scaled", keys))


def all_sticking() -> StubResult:
    """Nothing slides: mu is not determined and kappa has a lower limit only."""
    loose = Estimate(
        None,
        None,
        (0.3, np.inf),
        (0.2134, np.inf),
        "not_determined",
        "no impact slides; measure beyond 50 degrees",
    )
    angle = Estimate(None, None, (33.0, 90.0), (30.2, np.inf), "not_determined", "no impact slides")
    says = (
        "mu is not determined: no impact slides. These data say mu > 0.21 (95 %). Measure beyond 50 degrees."
    )
    base = build((Run("run 1", 12, gamma=(3.0, 28.0)),))
    return replace(
        base,
        constants={**base.constants, "mu": loose},
        derived={**base.derived, "kappa": loose, "transition_angle_deg": {"run 1": angle}},
        facts={
            **base.facts,
            "identifiable": Fact(False, says, {"rank": 1, "free": 2}, "rank = free constants"),
        },
        warnings=(),
    )


def separate() -> StubResult:
    """mu takes its own value in each series."""
    runs = (Run("dry"), Run("wet & <oiled>", spin_y=-0.4, mu=0.09))
    base = build(runs)
    kappa = 0.233
    return replace(
        base,
        constants={
            **base.constants,
            "mu": {"dry": estimate(0.12, 0.004), "wet & <oiled>": estimate(0.09, 0.0123)},
        },
        derived={
            **base.derived,
            "kappa": {"dry": estimate(0.233, 0.008), "wet & <oiled>": estimate(0.175, 0.024)},
        },
        state=State(
            ("e_n", "e_t", "kappa[dry]", "kappa[wet & <oiled>]"),
            np.array([0.94, -0.98, kappa, 0.175]),
            np.array([0.94, -0.98, kappa, 0.175]),
            np.diag([0.0, 0.0131, 0.008, 0.024]) ** 2,
            np.array([0.0, -1.0, 0.0, 0.0]),
            np.array([1.0, -0.4, np.inf, np.inf]),
        ),
    )


def contradicted() -> StubResult:
    """An outlier and lack of fit."""
    base = fine()
    points = base.points
    points.loc[20, ["value", "residual", "standardised"]] = [0.9, 0.6, 12.0]
    says = (
        "The data contradict a constant closure constant below 12 degrees (p = 2e-9): "
        "7 of 7 residuals positive. "
        "Microslip does this. Try --closure maw, or --gamma-min 12 if you only need oblique impacts."
    )
    facts_now = {
        **base.facts,
        "lack_of_fit": Fact(False, says, {"p": 2e-9}, "p >= 0.001"),
        "outliers": Fact(False, "impacts.csv, line 22 is an outlier.", {"rows": [22]}, "Bonferroni at 1 %"),
        "at_bound": Fact(False, "e_t lies on its bound -1.", {"e_t": -1.0}, "no constant on a bound"),
    }
    return replace(base, points=points, facts=facts_now)


def restitution() -> StubResult:
    """Values of e_n without an angle, beside beta."""
    return build((Run("drop tests", 40), Run("second day", 12)), ("e_n", "beta"))


def posterior(policy: str = "unknown") -> StubResult:
    """Two series with the exact posterior: means, noises with intervals, draws and evidence."""
    runs = (Run("dry"), Run("wet & <oiled>", spin_y=-0.4))
    base = build(runs)
    names = [f"{run.name}/beta" for run in runs] if policy == "unknown" else ["factor"]
    noises = {
        name: replace(estimate(value, 0.0062), mean=value + 0.001)
        for name, value in zip(names, (0.0481, 0.0555), strict=False)
    }
    rng = np.random.default_rng(5)
    state = base.state
    sample = np.clip(
        state.center + np.sqrt(np.diag(state.covariance)) * rng.standard_normal((50, 3)),
        state.lower,
        state.upper,
    )
    says = "the posterior predicts data like these (smallest p of 4 checks = 0.31, runs)"
    return replace(
        base,
        method="exact",
        constants={**base.constants, "mu": replace(estimate(0.12, 0.0041), mean=0.1203)},
        noise=NoiseSummary(policy, base.noise.sigma, noises, dict.fromkeys(names, (0.00029, 1.0))),
        fit=replace(base.fit, log_evidence=41.2367),
        facts={**base.facts, "predictive": Fact(True, says, {"failed": []}, "p >= 0.001")},
        state=replace(state, sample=sample),
    )


def scaled_posterior() -> StubResult:
    """The same with one factor that is common to all given sigmas."""
    return posterior("scaled")
