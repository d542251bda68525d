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
from functools import cache
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


Sample = tuple[Array, Array | None, str]  # draws, their weights, and anything that has to be said


@dataclass(frozen=True)
class Peer:
    """A sampler: the package it needs, a run of it with a seed, and what its first run compiles is called."""

    package: str
    sample: Callable[[Scene, int], Sample]
    slow: bool = True
    cold: str = ""


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Without progress and advice: what comes out is judged here."""
    logging.disable(logging.WARNING)
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        yield
    logging.disable(logging.NOTSET)


def run_of(peer: Peer, scene: Scene, seed: int) -> Run:
    """Run a sampler with the clock on; moments are worked out off the clock."""
    found: list[Sample] = []
    with quietly():
        seconds = seconds_of(lambda: found.append(peer.sample(scene, seed)))
    draws, weights, note = found[0]
    draws = draws[:, : len(scene.constants)]
    mean = np.average(draws, axis=0, weights=weights)
    return Run(mean, np.sqrt(np.average((draws - mean) ** 2, axis=0, weights=weights)), seconds, note)


def flat(chain: Callable[[Scene, int, int], Array], steps: int) -> Callable[[Scene, int], Sample]:
    """A sampler that walks so many steps; its walkers' draws all in one."""
    return lambda scene, seed: (chain(scene, seed, steps).reshape(-1, scene.dimensions), None, "")


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


def _dynesty(scene: Scene, seed: int) -> Sample:
    import dynesty

    sampler = dynesty.NestedSampler(
        scene.log_likelihood(),
        scene.from_unit_cube,
        scene.dimensions,
        nlive=500,
        rstate=np.random.default_rng(seed),
    )
    sampler.run_nested(print_progress=False)
    return sampler.results.samples, sampler.results.importance_weights(), ""


def _ultranest(scene: Scene, seed: int) -> Sample:
    import ultranest
    import ultranest.stepsampler

    np.random.seed(seed)  # noqa: NPY002 (UltraNest takes no other)
    sampler = ultranest.ReactiveNestedSampler(
        [f"p{i}" for i in range(scene.dimensions)],
        scene.log_likelihood(),
        scene.from_unit_cube,
        vectorized=True,
    )
    stepwise = scene.dimensions > 10  # rejection from ellipsoids does not come to an end there
    if stepwise:
        sampler.stepsampler = ultranest.stepsampler.SliceSampler(
            nsteps=2 * scene.dimensions,
            generate_direction=ultranest.stepsampler.generate_mixture_random_direction,
        )
    result = sampler.run(min_num_live_points=400, show_status=False, viz_callback=False)
    weighted = result["weighted_samples"]
    return weighted["points"], weighted["weights"], "slice sampler" if stepwise else ""


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


@cache
def _nuts(scene: Scene) -> Any:
    """NUTS on a scene; its first run compiles."""
    import numpyro

    numpyro.enable_x64()
    kernel = numpyro.infer.NUTS(_numpyro_model(scene))
    return numpyro.infer.MCMC(kernel, num_warmup=WARM_UP, num_samples=SAMPLES, progress_bar=False)


def _numpyro(scene: Scene, seed: int) -> Sample:
    import jax

    sampler = _nuts(scene)
    sampler.run(jax.random.PRNGKey(seed))
    got = {name: np.asarray(draws) for name, draws in sampler.get_samples().items()}
    return np.column_stack((got["e_n"], got["e_t"], got["mu"])), None, ""


PEERS = {
    EMCEE: Peer("emcee", flat(emcee_chain, 1000), slow=False),
    EMCEE_LONG: Peer("emcee", flat(emcee_chain, 5000), slow=False),
    LMFIT: Peer("emcee", flat(lmfit_chain, 1000)),
    DYNESTY: Peer("dynesty", _dynesty),
    ULTRANEST: Peer("ultranest", _ultranest),
    NUTS: Peer("numpyro", _numpyro, cold=NUTS_COLD),
}


def all_runs(scene: Scene, seeds: tuple[int, int], quick: bool) -> dict[str, list[Run]]:
    """Runs of every peer that is installed, with so many seeds of the quick and of the slow ones.

    One that takes very long runs with fewer.
    """
    found: dict[str, list[Run]] = {}
    for name, peer in PEERS.items():
        if quick and peer.slow:
            continue
        if importlib.util.find_spec(peer.package) is None:
            print(f"{peer.package} is not installed: {name} is left out.")
            continue
        print(f"scene {scene.key}: {name} ...", flush=True)
        cold = [run_of(peer, scene, 0)] if peer.cold else []
        runs: list[Run] = []
        for seed in range(1, seeds[peer.slow] + 1):
            runs.append(run_of(peer, scene, seed))
            if runs[-1].seconds > _SLOW:
                break
        found |= {name: runs} | ({peer.cold: cold} if cold else {})
    return found
