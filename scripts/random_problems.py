"""Random fits to try a solver on: every closure, every kind of data, truths in awkward places."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.observations import Observations, make_table
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closure import Closure
from ifrfit.physics.closures import CLOSURES
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.rebound import rebound_of

Array = NDArray[np.float64]

LINEAR_CLOSURES = tuple(name for name in CLOSURES if name in ("f", "fr", "ifr", "ifr-contact"))
TANGENTIAL = ("beta", "beta_cm", "tan_psi_after", "spin_y_after", "v_x")
LATERAL = ("v_y", "spin_x_after")


def random_problem(rng: np.random.Generator) -> Problem:
    """Draw a fit: any closure, 3 to 60 rows, with or without spin, one or two series, known uneven sigma."""
    closure = CLOSURES[str(rng.choice(LINEAR_CLOSURES))]
    inertia = float(rng.choice([0.4, 0.4, 2.0 / 3.0, 0.5, rng.uniform(0.1, 1.0)]))
    n = int(rng.integers(3, 61))
    observables, choices = _question(rng, closure, inertia)
    incidence, gamma, spin_x, spin_y = _impacts(rng, n, lateral=bool(set(observables) & set(LATERAL)))
    n_series = 2 if choices.get("separate") else 1
    series = rng.integers(0, n_series, n)
    series[:n_series] = np.arange(n_series)
    which = rng.integers(0, len(observables), n)
    truth = [_truth(rng, closure, inertia, choices.get("fix", {}), incidence.tau) for _ in range(n_series)]
    value, sigma = _measured(rng, closure, inertia, incidence, [observables[i] for i in which], series, truth)
    table = make_table(
        {
            "series": [f"s{i}" for i in series],
            "observable": [observables[i] for i in which],
            "gamma_deg": gamma,
            "spin_x": spin_x,
            "spin_y": spin_y,
            "value": value,
            "sigma": sigma,
        }
    )
    constants = make_parameters(closure, inertia, **choices)
    return make_problem(Observations(table), closure, inertia, constants, "known")


def _question(rng: np.random.Generator, closure: Closure, j: float) -> tuple[list[str], dict[str, object]]:
    """Draw what is measured, and what is known beforehand."""
    e_n = float(rng.choice([rng.uniform(0.05, 1.0), rng.uniform(0.9, 1.0)]))
    tangential = [str(x) for x in rng.choice(TANGENTIAL, size=rng.integers(1, 4), replace=False)]
    if rng.random() < 0.15:
        tangential.append(str(rng.choice(LATERAL)))
    road = str(
        rng.choice(["held", "held", "held", "any", "normal", "friction", "impulse", "rebound", "coupled"])
    )
    choices: dict[str, object] = {}
    if road == "held":
        observables, choices = tangential, {"fix": {"e_n": e_n}}
    elif road == "any":
        observables, choices = [*tangential, "mu_app", "tan_psi_out", "mu"], {"fix": {"e_n": e_n}}
    elif road == "normal":
        observables = [*tangential, str(rng.choice(["e_n", "v_n"]))]
    elif road == "friction":
        observables = [*tangential, "mu"]
    elif road == "impulse":
        observables = ["mu_app", "mu"] if rng.random() < 0.5 else ["mu_app"]
    elif road == "rebound":
        observables = ["tan_psi_out"]
    else:
        observables = [*tangential, "e_n", "mu"] if rng.random() < 0.5 else ["mu_app", "e_n"]
    if road == "held" and rng.random() < 0.25:
        choices["separate"] = ("mu",) if rng.random() < 0.5 or not closure.constant else (closure.constant,)
    prior: dict[str, tuple[float, float]] = {}
    if closure.constant and rng.random() < 0.1:
        low, high = closure.domain(j)
        prior[closure.constant] = (float(rng.uniform(low, high)), float(rng.uniform(0.02, 0.3)))
    if road in ("held", "friction") and rng.random() < 0.15:
        prior["mu"] = (float(rng.uniform(0.0, 0.6)), float(rng.uniform(0.01, 0.2)))
    if prior and "separate" not in choices:
        choices["prior"] = prior
    if rng.random() < 0.1:
        choices["bounds"] = {"mu": (float(rng.uniform(0.0, 0.1)), float(rng.uniform(0.2, 0.8)))}
    return observables, choices


def _impacts(rng: np.random.Generator, n: int, *, lateral: bool) -> tuple[Incidence, Array, Array, Array]:
    """Draw angles and spins: everywhere, only steep, only flat, or in a few groups; some rows are doubled."""
    low, high = [(1.0, 89.0), (1.0, 89.0), (1.0, 30.0), (50.0, 89.0)][rng.integers(4)]
    gamma = rng.uniform(low, high, n)
    if rng.random() < 0.2:
        gamma = rng.choice(np.round(gamma[:5], 1), n)
    spin_x, spin_y = np.zeros(n), np.zeros(n)
    if lateral or rng.random() < 0.3:
        spin_y = rng.choice([rng.uniform(-0.5, 0.9), 0.0]) + rng.normal(0.0, 0.3, n) * rng.integers(2)
    if lateral or rng.random() < 0.15:
        spin_x = rng.normal(0.0, 0.3, n)
    if rng.random() < 0.1:
        gamma[n // 2 :], spin_x[n // 2 :], spin_y[n // 2 :] = gamma[0], spin_x[0], spin_y[0]
    return Incidence.of(gamma, spin_x, spin_y, degrees=True), gamma, spin_x, spin_y


def _truth(
    rng: np.random.Generator, closure: Closure, j: float, fixed: object, tau: Array
) -> tuple[float, float, float]:
    """Draw (e_n, c, mu): anywhere, near a bound, or so that all rows stick or all slide."""
    e_n = dict(fixed).get("e_n", float(rng.uniform(0.3, 1.0)))  # type: ignore[call-overload]
    low, high = closure.domain(j)
    share = float(rng.choice([rng.uniform(), rng.uniform(), 0.0, 1.0, 1e-3]))
    c = low + share * (high - low)
    linear = closure.coefficients(j)
    bound = max(linear.b0 + linear.b1 * c, 1e-3)
    finite = tau[np.isfinite(tau)]
    transition = [
        float(rng.choice(finite)),
        float(rng.uniform(finite.min(), finite.max())),
        1.5 * float(finite.max()),
        0.5 * float(finite.min()),
        0.0,
    ][int(rng.choice(5, p=[0.3, 0.4, 0.12, 0.12, 0.06]))]
    return e_n, c, min(bound * transition / (1.0 + e_n), 3.0)


def _measured(
    rng: np.random.Generator,
    closure: Closure,
    j: float,
    incidence: Incidence,
    names: Sequence[str],
    series: NDArray[np.intp],
    truth: Sequence[tuple[float, float, float]],
) -> tuple[Array, Array]:
    """Draw values and their sigma; a tenth of the problems are noise and nothing else."""
    constants = np.array(truth)[series]
    state = rebound_of(incidence, closure, constants[:, 0], constants[:, 1], constants[:, 2], j)
    exact = np.array([np.broadcast_to(OBSERVABLES[x].value(state, constants[:, 2]), series.shape)[i]
                      for i, x in enumerate(names)])  # fmt: skip
    size = 1.0 if rng.random() < 0.1 else float(np.exp(rng.uniform(np.log(1e-3), np.log(0.5))))
    uneven = np.exp(rng.normal(0.0, float(rng.choice([0.0, 0.5, 2.0])), series.size))
    # ratios to sin or cos grow at the ends of the angles, and so does what is uncertain about them
    sigma = np.clip(size * uneven * np.maximum(1.0, np.abs(exact)), 1e-9, 1e5)
    value = exact + sigma * rng.standard_normal(series.size)
    return np.where(np.isin(names, ("e_n", "v_n", "mu")), np.abs(value), value), sigma
