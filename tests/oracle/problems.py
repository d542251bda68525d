"""The table of problems whose results are frozen: public calls on bundled datasets and on made tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from oracle.differences import TOLERANCE

Options = Mapping[str, Any]

# Where the optimum is found by iteration (observables curved in the constants, closure maw, a constant that
# ties the series), rounding decides at which step it stops. The last bit of the measured values moves such
# results by up to 1e-8, and by up to 5e-8 where the optimum is flat as well.
ITERATED = 1e-7
FLAT = 1e-6
TOLERANCES = {
    **dict.fromkeys(("wang", "reagle-free-profile"), FLAT),
    **dict.fromkeys(
        (
            "wang-free-lsq",
            "reagle",
            "hashemnia-maw",
            "maw",
            "maw-fixed-chi",
            "maw-profile",
            "maw-separate",
            "separate-e_n",
            "separate-mu-prior",
            "student-t-unknown",
            "beta_tot",
            "beta_tot-free",
            "beta_tot-unknown",
            "lambda",
            "delta",
            "delta-unknown",
            "delta-profile",
            "psi-after",
            "mcmc-delta",
            "mcmc-maw",
            "bootstrap-delta",
            "compare-maw",
        ),
        ITERATED,
    ),
}

# Chains are the same as long as no rounding decides where they start: problems of mcmc are such that the last
# bit of the measured values does not.

# Entries that hang on a rounding and are not compared. In netl-lsq nothing is known of e_t, and its local
# Gaussian is centred on its bound: the tail that a draw is taken from is the sign of a zero.
UNSTABLE: Mapping[str, tuple[str, ...]] = {
    "netl-lsq": ("draws.e_t",),
    # the search for a drift of a refuted law runs out of steps: 0.02 of 1,555 away on another processor
    "two-datasets": ("facts.slips.figures.tests.friction-drift.",),
}

# curves with bands that are asked of a fit
BETA = {"gamma": [10.0, 30.0, 50.0, 70.0], "observable": "beta"}


@dataclass(frozen=True)
class Problem:
    """One call of the package and what of it is frozen.

    Attributes
    ----------
    name : str
    call : {"fit", "compare", "simulate", "simulate-fit", "rebound"}
    data : str or tuple of str
        A bundled dataset, or ``table:NAME`` of `tables.RUNS`, or several; a scene of ``docs/scenes``.
    options : mapping
        Keywords of the call.
    predict : tuple of mapping
        Keywords of `FitResult.predict`, one a call.
    intervals : bool
        Whether `FitResult.intervals` is frozen too.
    quick : bool
        Whether the problem is tested by default; the others are with ``-m long``.
    """

    name: str
    call: str
    data: str | tuple[str, ...] = ""
    options: Options = field(default_factory=dict)
    predict: tuple[Options, ...] = ()
    intervals: bool = False
    quick: bool = False

    @property
    def tolerance(self) -> float:
        """Of its numbers, relative or in units of their natural scale."""
        return TOLERANCES.get(self.name, TOLERANCE)

    @property
    def unstable(self) -> tuple[str, ...]:
        """Entries that are not compared."""
        return UNSTABLE.get(self.name, ())


def fit(
    name: str,
    data: str | tuple[str, ...],
    *,
    predict: Options | tuple[Options, ...] = (),
    intervals: bool = False,
    quick: bool = False,
    **options: Any,
) -> Problem:
    """A problem of `ifrfit.fit`."""
    asked = (predict,) if isinstance(predict, Mapping) else predict
    return Problem(name, "fit", data, options, asked, intervals, quick)


KHARAZ: Options = {"prior": {"e_n": (0.98, 0.01)}, "gamma_min": 15.0}
CUT: Options = {"fix": {"e_n": 0.98}, "bounds": {"mu": (0.0, 0.085)}, "gamma_min": 15.0}
MEASURED: Options = {"angle_errors": "measured", "angle_population": (0.0, 85.0)}

DATASETS = (
    fit("kharaz-prior", "kharaz-2001", **KHARAZ, predict=BETA, intervals=True, quick=True),
    fit("kharaz-prior-lsq", "kharaz-2001", **KHARAZ, method="lsq", predict=BETA),
    fit("kharaz-prior-profile", "kharaz-2001", **KHARAZ, method="profile"),
    fit("kharaz-cut-lsq", "kharaz-2001", **CUT, method="lsq", quick=True),
    fit("kharaz-cut-profile", "kharaz-2001", **CUT, method="profile"),
    fit("kharaz-cut-exact", "kharaz-2001", **CUT, predict=BETA),
    fit("kharaz-unknown", "kharaz-2001", fix={"e_n": 0.98}, noise="unknown"),
    fit("kharaz-known", "kharaz-2001", fix={"e_n": 0.98}, noise="known", gamma_min=15.0),
    fit("kharaz-psi", "kharaz-2001", fix={"e_n": 0.98}, observable="psi_out_deg"),
    fit(
        "kharaz-independent",
        "kharaz-2001",
        fix={"e_n": 0.98},
        series=("kratos", "mfix"),
        separate="mu",
        observable="beta_cm",
        independent=True,
        method="lsq",
        predict={**BETA, "series": "mfix"},
    ),
    fit("netl", "netl-glass-acrylic", quick=True),
    fit("netl-lsq", "netl-glass-acrylic", method="lsq"),
    fit("cross", "cross-2019", fix={"e_n": 0.85}, predict=BETA),
    fit(
        "cross-separate",
        "cross-2019",
        fix={"e_n": 0.85},
        observable="beta",
        separate="e_t",
        series=("no spin", "spin 0.225"),
        predict={**BETA, "series": "spin 0.225", "spin_y": 0.225},
    ),
    fit("cross-mu_app", "cross-2019", fix={"e_n": 0.85}, observable="mu_app"),
    fit("wang", "wang-2020", prior={"e_n": (0.8, 0.05)}, predict={**BETA, "observable": "delta_deg"}),
    fit("wang-free-lsq", "wang-2020", method="lsq"),
    fit("reagle", "reagle-2013", fix={"e_n": 0.38}, predict={**BETA, "observable": "beta_tot"}),
    fit("reagle-free-profile", "reagle-2013", method="profile"),
    fit("buck", "buck-2017", fix={"e_n": 0.95}, inertia_factor=0.4),
    fit("hashemnia-fr", "hashemnia-2019", closure="fr", fix={"e_n": 0.9}),
    fit("hashemnia-maw", "hashemnia-2019", closure="maw", fix={"e_n": 0.9}, method="lsq"),
    fit("two-datasets", ("buck-2017", "hashemnia-2019"), fix={"e_n": 0.95}, separate=("mu", "e_t")),
)

CLOSURES = (
    fit("ifr", "table:beta-e_n", predict=BETA, intervals=True, quick=True),
    fit("ifr-beta-alone", "table:beta"),
    fit("fr", "table:fr", closure="fr", predict=BETA, quick=True),
    fit("fr-by-ifr", "table:fr", closure="ifr", method="lsq"),
    fit("fr-separate", "table:fr-two-series", closure="fr", fix={"e_n": 0.9}, separate="beta0"),
    fit("f", "table:f", closure="f", predict=BETA, quick=True),
    fit("f-profile", "table:f", closure="f", method="profile"),
    fit("ifr-contact", "table:ifr-contact", closure="ifr-contact", fix={"e_n": 0.94}, quick=True),
    fit("maw", "table:maw", closure="maw", predict=BETA),
    fit("maw-fixed-chi", "table:maw", closure="maw", fix={"chi": 1.44}, predict=BETA),
    fit("maw-profile", "table:maw", closure="maw", method="profile", fix={"e_n": 0.95, "chi": 1.44}),
    fit(
        "maw-separate", "table:maw-two-series", closure="maw", fix={"e_n": 0.95}, separate="chi", method="lsq"
    ),
)

NOISE = (
    fit("unknown", "table:beta-bare"),
    fit("unknown-lsq", "table:beta-bare", method="lsq", quick=True),
    fit("unknown-profile", "table:beta-bare", method="profile"),
    fit("scaled", "table:beta-understated", noise="scaled", predict=BETA),
    fit("scaled-lsq", "table:beta-understated", noise="scaled", method="lsq"),
    fit("known-misfit", "table:beta-understated", noise="known"),
    fit("three-noises", "table:three-bare", predict={**BETA, "observable": "beta_cm"}),
    fit("three-noises-lsq", "table:three-bare", method="lsq"),
    fit("four-noises", "table:two-series-bare", separate="mu", method="lsq"),
    fit("four-noises-exact", "table:two-series-bare"),
    fit("repeats", "table:repeats", fix={"e_n": 0.94}),
    fit("delta-unknown", "table:delta-bare", fix={"e_n": 0.94}, predict={**BETA, "observable": "delta_deg"}),
    fit("beta_tot-unknown", "table:beta_tot-bare", fix={"e_n": 0.94}, method="lsq"),
)

SEPARATE = (
    fit("separate-mu", "table:two-series", separate="mu", predict={**BETA, "series": "b", "spin_y": 0.3}),
    fit("separate-e_n", "table:two-series", separate="e_n", method="lsq"),
    fit("separate-e_t-mu", "table:two-series", separate=("e_t", "mu"), quick=True),
    fit("separate-all", "table:two-series-small", separate=("e_n", "e_t", "mu")),
    fit("separate-mu-prior", "table:two-series-small", separate="mu", prior={"mu": (0.13, 0.01)}),
    fit(
        "separate-profile",
        "table:two-series-small",
        separate="mu",
        fix={"e_n": 0.94, "e_t": -0.9},
        method="profile",
    ),
    fit("separate-three", "table:three-series", separate="mu", fix={"e_n": 0.94}),
    fit("shared-three", "table:three-series", noise="scaled"),
)

DOMAIN = (
    fit("fix-e_t", "table:beta-e_n", fix={"e_t": -0.9}),
    fit("fix-mu", "table:beta", fix={"mu": 0.12}),
    fit("fix-all-but-mu", "table:beta", fix={"e_n": 0.94, "e_t": -0.9}, predict=BETA),
    fit("prior-e_t", "table:sliding", fix={"e_n": 0.94}, prior={"e_t": (-0.8, 0.05)}),
    fit("bounds-e_n", "table:beta", bounds={"e_n": (0.9, 1.0)}, predict=BETA),
    fit("bounds-kappa-cut", "table:beta-e_n", bounds={"mu": (0.0, 0.118)}),
    fit("bounds-kappa-cut-lsq", "table:beta-e_n", bounds={"mu": (0.0, 0.118)}, method="lsq"),
    fit("bounds-kappa-cut-profile", "table:small", bounds={"mu": (0.0, 0.118)}, method="profile"),
    fit("sliding-only", "table:sliding", fix={"e_n": 0.94}),
    fit("sliding-only-lsq", "table:sliding", fix={"e_n": 0.94}, method="lsq"),
    fit("sticking-only", "table:sticking", fix={"e_n": 0.94}),
    fit("sticking-only-profile", "table:sticking", fix={"e_n": 0.94}, method="profile"),
    fit("frictionless", "table:frictionless", fix={"e_n": 0.94}),
    fit("few-rows", "table:beta-few", method="lsq"),
    fit("exclude", "table:outliers", exclude=(5, 16), method="lsq"),
    fit("speeds", "table:speeds", speed_min=1.0, speed_max=3.5),
    fit("speeds-scene", "table:speeds", scene="docs/scenes/kharaz.toml", method="lsq"),
)

SCATTER = (
    fit("student-t", "table:outliers", tails="student-t", predict=BETA),
    fit("student-t-lsq", "table:outliers", tails="student-t", dof=3.0, method="lsq"),
    fit("student-t-unknown", "table:outliers-bare", tails="student-t", fix={"e_n": 0.94}),
    fit("outliers-gaussian", "table:outliers", method="lsq"),
    fit("angles-effective", "table:angles", angle_errors="effective"),
    fit("angles-effective-lsq", "table:angles", angle_errors="effective", method="lsq"),
    fit("angles-set", "table:angles", angle_errors="set"),
    fit("angles-set-student-t", "table:angles", angle_errors="set", tails="student-t"),
    fit("angles-measured", "table:angles", **MEASURED),
    fit("angles-centre", "table:angles-centre", angle_errors="set", fix={"e_n": 0.94}),
    fit("angles-offset", "table:beta-e_n", angle_offset=1.0, quick=True),
    fit("angles-offset-lsq", "table:beta-e_n", angle_offset=1.0, method="lsq", noise="scaled"),
    fit("angles-sigma-gamma", "table:beta-e_n", angle_errors="set", sigma_gamma=1.0),
    fit("spins-set", "table:spins", angle_errors="set", fix={"e_n": 0.94, "e_t": -0.9}),
    fit("spins-effective", "table:spins", angle_errors="effective", fix={"e_n": 0.94}),
    fit("propagated", "table:three", sigma_velocity=0.02, sigma_spin=0.025),
    fit("propagated-lsq", "table:three", sigma_velocity=0.02, sigma_spin=0.025, method="lsq"),
)

OBSERVABLES = (
    fit("three", "table:three", predict={**BETA, "observable": "spin_y_after"}),
    fit("delta", "table:delta", predict={**BETA, "observable": "delta_deg"}),
    fit("delta-profile", "table:delta-small", method="profile", fix={"e_n": 0.94}),
    fit("mu_app", "table:mu_app", predict={**BETA, "observable": "mu_app"}, quick=True),
    fit("beta_tot", "table:beta_tot", fix={"e_n": 0.94}),
    fit("beta_tot-free", "table:beta_tot", method="lsq"),
    fit("psi", "table:psi", predict={**BETA, "observable": "psi_out_deg"}),
    fit("tan-psi", "table:tan-psi"),
    fit("tan-psi-out", "table:tan-psi-out", fix={"e_n": 0.94}),
    fit("psi-after", "table:psi-after", fix={"e_n": 0.94}),
    fit("mu-rows", "table:mu-rows"),
    fit("velocities", "table:velocities", predict={**BETA, "observable": "v_x", "spin_y": 0.3}),
    fit("lateral", "table:lateral", predict={**BETA, "observable": "lambda_deg", "spin_x": 0.3}),
    fit("lambda", "table:lambda"),
    fit("raw", "table:raw", predict=BETA, quick=True),
    fit("raw-lsq", "table:raw", method="lsq"),
    fit("hollow", "table:hollow", inertia_factor=2 / 3, predict=BETA),
    fit("hollow-centre-fr", "table:hollow-centre", closure="fr", inertia_factor=2 / 3, method="lsq"),
    fit("disc", "table:disc", inertia_factor=0.5, fix={"e_n": 0.94}),
)

METHODS = (
    fit("accuracy-1e-2", "table:beta-e_n", accuracy=1e-2),
    fit("accuracy-1e-7", "table:beta-e_n", accuracy=1e-7, method="exact", predict=BETA),
    fit("accuracy-unknown", "table:beta-bare", accuracy=1e-6),
    fit("mcmc", "table:beta-e_n", method="mcmc", max_steps=100, seed=3, predict=BETA),
    fit("mcmc-unknown", "table:beta-bare", method="mcmc", max_steps=100, seed=4),
    fit("mcmc-student-t", "table:outliers", method="mcmc", tails="student-t", max_steps=100, seed=5),
    fit("mcmc-fr", "table:fr", closure="fr", method="mcmc", gamma_min=8.0, max_steps=100, seed=6),
    fit("mcmc-delta", "table:delta-small", method="mcmc", max_steps=60, seed=8),
    fit("mcmc-maw", "table:maw-few", closure="maw", method="mcmc", prior={"e_n": (0.95, 0.01)}, max_steps=40),
    fit("mcmc-angles", "table:angles-centre", method="mcmc", angle_errors="set", max_steps=40),
    fit("bootstrap-cases", "table:beta-e_n", method="bootstrap", replicates=100, predict=BETA, quick=True),
    fit("bootstrap-residual", "table:beta-e_n", method="bootstrap", resample="residual", replicates=100),
    fit("bootstrap-wild", "table:beta-bare", method="bootstrap", resample="wild", replicates=100),
    fit("bootstrap-mammen", "table:three-bare", method="bootstrap", resample="wild-mammen", replicates=100),
    fit("bootstrap-separate", "table:two-series", method="bootstrap", separate="mu", replicates=100, seed=2),
    fit("bootstrap-known", "table:three", method="bootstrap", replicates=100, seed=7),
    fit(
        "bootstrap-delta",
        "table:delta-few",
        method="bootstrap",
        fix={"e_n": 0.94, "e_t": -0.9},
        replicates=100,
    ),
    fit("bootstrap-fr", "table:fr", closure="fr", method="bootstrap", replicates=100),
)

COMPARISONS = (
    Problem("compare-kharaz", "compare", "kharaz-2001", {**KHARAZ, "closures": ("ifr", "fr", "f")}),
    Problem("compare-fr", "compare", "table:fr", {"closures": ("ifr", "fr"), "seed": 1}, quick=True),
    Problem(
        "compare-separate",
        "compare",
        "table:two-series",
        {"closures": ("ifr", "ifr-contact"), "separate": "mu", "fix": {"e_n": 0.94}},
    ),
    Problem(
        "compare-maw", "compare", "table:maw", {"closures": ("fr", "maw"), "fix": {"e_n": 0.95}, "loo": False}
    ),
)

SIMULATIONS = (
    Problem("simulate-dust", "simulate", "dust", {"samples": 20, "seed": 1}, quick=True),
    Problem("simulate-fine-glass", "simulate", "fine-glass"),
    Problem("simulate-kharaz", "simulate", "kharaz"),
    Problem("simulate-lateral-spin", "simulate", "lateral-spin"),
    Problem("simulate-table-tennis", "simulate", "table-tennis"),
    Problem("simulate-wet-bead", "simulate", "wet-bead", {"samples": 30, "seed": 2}),
    Problem("simulate-fit", "simulate-fit", "table:two-series", {"samples": 25, "seed": 3}),
)

REBOUNDS = tuple(
    Problem(f"rebound-{closure}", "rebound", options={"closure": closure, "e_n": 0.9, "mu": 0.15, **own})
    for closure, own in (
        ("ifr", {"e_t": -0.85}),
        ("fr", {"beta0": 0.4, "inertia_factor": 2 / 3}),
        ("f", {}),
        ("ifr-contact", {"e_t": -0.6}),
        ("maw", {"chi": 1.44}),
    )
)

PROBLEMS: tuple[Problem, ...] = (
    *DATASETS,
    *CLOSURES,
    *NOISE,
    *SEPARATE,
    *DOMAIN,
    *SCATTER,
    *OBSERVABLES,
    *METHODS,
    *COMPARISONS,
    *SIMULATIONS,
    *REBOUNDS,
)
BY_NAME: Mapping[str, Problem] = {problem.name: problem for problem in PROBLEMS}
