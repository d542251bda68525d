"""Samplers on the scenes of the posterior benchmark, each as its own users would call it.

All draw from the same posterior in (e_n, e_t, mu), with the logarithms of unknown sigmas beside them, and
return means and standard deviations. They are imported when they run; one that is not installed is left out.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import logging
import os
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

# jax reads this when it is imported; one thread, as for everybody else
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

import numpy as np
from _common import seconds_of
from posterior_scenes import (
    E_N_DOMAIN,
    E_N_PRIOR,
    E_T_DOMAIN,
    MU_DOMAIN,
    NOISE_DOMAIN,
    SHARE,
    SIGMA_E_N,
    J,
    Scene,
)

Array = np.ndarray

WALKERS = 50
DISCARDED = 0.2
BALL = 0.01  # of the domain's width, about the least squares: where walkers start
WARM_UP, SAMPLES = 500, 2000
_SLOW = 60.0  # seconds of one run after which there is no other

EMCEE, EMCEE_LONG = f"emcee {WALKERS} x 1,000", f"emcee {WALKERS} x 5,000"
LMFIT = f"lmfit emcee {WALKERS} x 1,000"
DYNESTY, ULTRANEST = "dynesty 500", "UltraNest 400"
NUTS, NUTS_COLD = f"numpyro NUTS {WARM_UP} + {SAMPLES:,}", "numpyro NUTS, with compilation"


@dataclass(frozen=True)
class Run:
    """What one run gave: moments of the constants, and anything that has to be said."""

    mean: Array
    sd: Array
    seconds: float
    note: str = ""


@dataclass(frozen=True)
class Peer:
    """A sampler: its name, the package it needs, and a run of it with a seed."""

    name: str
    package: str
    run: Callable[[Scene, int], list[Run]]
    slow: bool = True

    @property
    def is_here(self) -> bool:
        return importlib.util.find_spec(self.package) is not None


def runs_of(peer: Peer, scene: Scene, seeds: int) -> list[Run]:
    """Runs with different seeds, fewer where one takes very long."""
    runs: list[Run] = []
    for seed in range(1, seeds + 1):
        runs += peer.run(scene, seed)
        if runs[-1].seconds > _SLOW:
            break
    return runs


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Without progress and advice: what comes out is judged here."""
    logging.disable(logging.WARNING)
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        yield
    logging.disable(logging.NOTSET)


def _timed(scene: Scene, sample: Callable[[], tuple[Array, Array | None, str]]) -> Run:
    """Run a sampler with the clock on; moments are worked out off the clock."""
    found: list[tuple[Array, Array | None, str]] = []
    with quietly():
        seconds = seconds_of(lambda: found.append(sample()))
    draws, weights, note = found[0]
    draws = draws[:, : len(scene.constants)]
    mean = np.average(draws, axis=0, weights=weights)
    return Run(mean, np.sqrt(np.average((draws - mean) ** 2, axis=0, weights=weights)), seconds, note)


def emcee_chain(scene: Scene, seed: int, steps: int) -> Array:
    """Plain emcee on a likelihood of many points at once, (steps kept, walkers, d)."""
    import emcee

    log_likelihood = scene.log_likelihood()

    def log_posterior(theta: Array) -> Array:
        prior = scene.log_prior(theta)
        inside = np.isfinite(prior)
        with np.errstate(all="ignore"):  # outside the domain anything may come out, and is not used
            return np.where(inside, prior + log_likelihood(theta), -np.inf)

    rng = np.random.default_rng(seed)
    lower, upper = scene.domain
    walkers = scene.start() + BALL * (upper - lower) * rng.standard_normal((WALKERS, scene.dimensions))
    walkers = np.clip(walkers, lower + 1e-9, upper - 1e-9)
    sampler = emcee.EnsembleSampler(WALKERS, scene.dimensions, log_posterior, vectorize=True)
    sampler.random_state = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(walkers, steps)
    return np.asarray(sampler.get_chain(discard=int(DISCARDED * steps)))


def _emcee(scene: Scene, seed: int, steps: int) -> list[Run]:
    def sample() -> tuple[Array, None, str]:
        return emcee_chain(scene, seed, steps).reshape(-1, scene.dimensions), None, ""

    return [_timed(scene, sample)]


def lmfit_chain(scene: Scene, seed: int, steps: int) -> Array:
    """A `Minimizer` with a residual, then its `emcee`, (steps kept, walkers, d).

    Two unknown sigmas need a log posterior.
    """
    import lmfit

    start, (lower, upper) = scene.start(), scene.domain
    names = [f"p{i}" for i in range(scene.dimensions)]
    log_likelihood = scene.log_likelihood()

    def theta_of(params: Any) -> Array:
        values = params.valuesdict()
        return np.array([values[name] for name in names])

    def residual(params: Any) -> Array:
        return scene.residual(theta_of(params))

    def log_posterior(params: Any) -> float:
        return float(log_likelihood(theta_of(params)))

    params = lmfit.Parameters()
    for name, value, low, high in zip(names, start, lower, upper, strict=True):
        params.add(name, value=float(value), min=float(low), max=float(high))
    settings = {
        "steps": steps,
        "burn": int(DISCARDED * steps),
        "nwalkers": WALKERS,
        "seed": seed,
        "progress": False,
    }
    if scene.unknown_noise:
        found = lmfit.Minimizer(log_posterior, params).emcee(float_behavior="posterior", **settings)
    else:
        minimizer = lmfit.Minimizer(residual, params)
        best = minimizer.minimize(method="leastsq")
        found = minimizer.emcee(params=best.params, is_weighted=True, **settings)
    return np.asarray(found.chain)


def _lmfit(scene: Scene, seed: int) -> list[Run]:
    def sample() -> tuple[Array, None, str]:
        return lmfit_chain(scene, seed, 1000).reshape(-1, scene.dimensions), None, ""

    return [_timed(scene, sample)]


def _dynesty(scene: Scene, seed: int) -> list[Run]:
    import dynesty

    def sample() -> tuple[Array, Array, str]:
        sampler = dynesty.NestedSampler(
            scene.log_likelihood(),
            scene.from_unit_cube,
            scene.dimensions,
            nlive=500,
            rstate=np.random.default_rng(seed),
        )
        sampler.run_nested(print_progress=False)
        return sampler.results.samples, sampler.results.importance_weights(), ""

    return [_timed(scene, sample)]


def _ultranest(scene: Scene, seed: int) -> list[Run]:
    import ultranest
    import ultranest.stepsampler

    stepwise = scene.dimensions > 10  # rejection from ellipsoids does not come to an end there

    def sample() -> tuple[Array, Array, str]:
        np.random.seed(seed)  # noqa: NPY002 (UltraNest takes no other)
        sampler = ultranest.ReactiveNestedSampler(
            [f"p{i}" for i in range(scene.dimensions)],
            scene.log_likelihood(),
            scene.from_unit_cube,
            vectorized=True,
        )
        if stepwise:
            sampler.stepsampler = ultranest.stepsampler.SliceSampler(
                nsteps=2 * scene.dimensions,
                generate_direction=ultranest.stepsampler.generate_mixture_random_direction,
            )
        result = sampler.run(min_num_live_points=400, show_status=False, viz_callback=False)
        weighted = result["weighted_samples"]
        return weighted["points"], weighted["weights"], "slice sampler" if stepwise else ""

    return [_timed(scene, sample)]


def _numpyro_model(scene: Scene) -> Callable[[], None]:
    """The scene as one writes it in numpyro."""
    import jax.numpy as jnp
    import numpyro
    from numpyro import distributions as dist

    cot, tan = jnp.asarray(scene.cot), jnp.asarray(scene.tan)
    value, e_n_seen, series = jnp.asarray(scene.value), jnp.asarray(scene.e_n), jnp.asarray(scene.series)

    def model() -> None:
        if scene.e_n.size:
            e_n = numpyro.sample("e_n", dist.Uniform(*E_N_DOMAIN))
        else:
            e_n = numpyro.sample(
                "e_n", dist.TruncatedNormal(*E_N_PRIOR, low=E_N_DOMAIN[0], high=E_N_DOMAIN[1])
            )
        e_t = numpyro.sample("e_t", dist.Uniform(*E_T_DOMAIN))
        if scene.n_series > 1:
            with numpyro.plate("runs", scene.n_series):
                mu = numpyro.sample("mu", dist.Uniform(*MU_DOMAIN))
            mu = mu[series]
        else:
            mu = numpyro.sample("mu", dist.Uniform(*MU_DOMAIN))
        sigma, sigma_e_n = scene.sigma, SIGMA_E_N
        if scene.unknown_noise:
            sigma = numpyro.sample("sigma", dist.LogUniform(*NOISE_DOMAIN))
            sigma_e_n = numpyro.sample("sigma_e_n", dist.LogUniform(*NOISE_DOMAIN))
        impulse = jnp.minimum(J, mu * (1.0 + e_n) * cot)
        if scene.observable == "beta":
            fitted = e_t + impulse / SHARE
        else:
            fitted = jnp.degrees(jnp.arctan((1.0 - SHARE * (1.0 + e_t) - impulse) * tan / e_n))
        numpyro.sample("value", dist.Normal(fitted, sigma), obs=value)
        if scene.e_n.size:
            numpyro.sample("e_n_seen", dist.Normal(e_n, sigma_e_n), obs=e_n_seen)

    return model


def _numpyro(scene: Scene, seeds: int) -> list[Run]:
    """First the run that compiles, then as many others as there are seeds."""
    import jax
    import numpyro

    numpyro.enable_x64()
    mcmc: list[Any] = []

    def sample(seed: int) -> tuple[Array, None, str]:
        if not mcmc:
            kernel = numpyro.infer.NUTS(_numpyro_model(scene))
            mcmc.append(
                numpyro.infer.MCMC(kernel, num_warmup=WARM_UP, num_samples=SAMPLES, progress_bar=False)
            )
        mcmc[0].run(jax.random.PRNGKey(seed))
        got = {name: np.asarray(draws) for name, draws in mcmc[0].get_samples().items()}
        return np.column_stack((got["e_n"], got["e_t"], got["mu"])), None, ""

    return [_timed(scene, lambda seed=seed: sample(seed)) for seed in range(seeds + 1)]


def numpyro_runs(scene: Scene, seeds: int) -> tuple[list[Run], list[Run]]:
    """Runs with everything compiled, and the one before them."""
    cold, *warm = _numpyro(scene, seeds)
    return warm, [cold]


PEERS = (
    Peer(EMCEE, "emcee", lambda scene, seed: _emcee(scene, seed, 1000), slow=False),
    Peer(EMCEE_LONG, "emcee", lambda scene, seed: _emcee(scene, seed, 5000), slow=False),
    Peer(LMFIT, "emcee", _lmfit),
    Peer(DYNESTY, "dynesty", _dynesty),
    Peer(ULTRANEST, "ultranest", _ultranest),
)


def all_runs(scene: Scene, seeds: tuple[int, int], quick: bool) -> dict[str, list[Run]]:
    """Runs of every peer that is installed, with so many seeds of the quick and of the slow ones."""
    found: dict[str, list[Run]] = {}
    for peer in PEERS:
        if quick and peer.slow:
            continue
        if not peer.is_here:
            print(f"{peer.package} is not installed: {peer.name} is left out.")
            continue
        print(f"scene {scene.key}: {peer.name} ...", flush=True)
        found[peer.name] = runs_of(peer, scene, seeds[peer.slow])
    if not quick:
        if importlib.util.find_spec("numpyro") is None:
            print(f"numpyro is not installed: {NUTS} is left out.")
        else:
            print(f"scene {scene.key}: {NUTS} ...", flush=True)
            found[NUTS], found[NUTS_COLD] = numpyro_runs(scene, seeds[1])
    return found
