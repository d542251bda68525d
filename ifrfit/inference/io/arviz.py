"""For those who continue in ArviZ: a posterior as its object."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.model.common_errors import refuse
from ifrfit.inference.model.entry_names import entry_name, split_name
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.posterior import ImportancePosterior

if TYPE_CHECKING:
    from ifrfit.inference.mcmc import Sample
    from ifrfit.inference.result.findings import Findings

Array = NDArray[np.float64]

_CHAINS, _DRAWS = 4, 1000  # of the exact posterior, whose draws are independent
_MOST = 20_000_000  # values of the log likelihood
_AT_ONCE = 2_000_000  # of them worked out together
_INDEPENDENT = 2.0  # autocorrelation times after which a draw knows nothing of the one before


def to_arviz(result: Findings) -> Any:
    """Put a posterior into ArviZ's form; see `FitResult.to_arviz`."""
    try:
        from arviz_base import from_dict
    except ImportError:
        raise UsageError(
            "ArviZ is not installed, which to_arviz() needs: pip install 'ifrfit[arviz]'."
        ) from None
    problem, _ = result.problem_and_optimum()
    if not result.is_posterior:
        raise UsageError(
            f"--method {result.method} gives no posterior, which to_arviz() needs: use exact or mcmc."
        )
    if problem.common is not None:
        raise refuse("The log likelihood of each impact, which to_arviz() gives,")
    density = Density(problem)
    allowed = int(max(_CHAINS, _MOST // max(problem.rows.value.size, 1)))  # by the size of the log likelihood
    sample = _sample_of(result)
    draws, sampler = _independent(result, allowed) if sample is None else _of_chains(sample, allowed)
    shape = next(iter(draws.values())).shape
    points = density.points(draws)
    impacts = density.impacts_in_parts(points, _AT_ONCE)
    log_posterior = density.log_prior(points) + impacts.sum(axis=1)
    table = problem.observations.table
    rows = [f"{source}:{row}" for source, row in zip(table["source"], table["row"], strict=True)]
    first = np.unique(density.impact, return_index=True)[1]
    ids = [table["impact_id"].iloc[i] or rows[i] for i in first]
    about = _about(result) | sampler
    posterior, dims, coords = _by_name(draws)
    return from_dict(
        {
            "posterior": posterior,
            "sample_stats": {"lp": log_posterior.reshape(shape)},
            "log_likelihood": {"impact": impacts.reshape(*shape, -1)},
            "observed_data": {"value": problem.rows.value},
        },
        coords={"impact_id": ids, "row": rows} | coords,
        dims={"impact": ["impact_id"], "value": ["row"]} | dims,
        attrs={"/": about, "posterior": about},
    )


def _by_name(
    draws: Mapping[str, Array],
) -> tuple[dict[str, Array], dict[str, list[str]], dict[str, list[str]]]:
    """mu[a] and mu[b] as one variable mu with a dimension, as ArviZ has them; its dimensions and labels."""
    labels: dict[str, list[str]] = {}
    for name in draws:
        kind, label = split_name(name)
        labels.setdefault(kind, []).extend([label] if label else [])
    posterior, dims, coords = {}, {}, {}
    for kind, own in labels.items():
        if own:
            dims[kind] = ["noise_of" if kind == "noise" else "series"]
            coords[dims[kind][0]] = own
        several = [draws[entry_name(kind, label)] for label in own]
        posterior[kind] = np.stack(several, axis=-1) if own else draws[kind]
    return posterior, dims, coords


def _about(result: Findings) -> dict[str, Any]:
    """Where the draws come from: what netCDF can hold of it, that is numbers and texts."""
    return {
        "inference_library": "ifrfit",
        "inference_library_version": result.versions.get("ifrfit", ""),
        "closure": result.closure,
        "method": result.method,
        "noise": result.noise.policy,
        "inertia_factor": result.inertia_factor,
        "seed": result.seed,
        "command": result.command,
        "created": result.created,
        "data": ", ".join(source.name for source in result.inputs),
        "sha256": ", ".join(source.sha256 for source in result.inputs),
        "provenance": ", ".join(kind for kind in result.provenance if kind) or "not stated",
        "versions": ", ".join(f"{name} {version}" for name, version in result.versions.items()),
        "converged": str(result.facts["converged"].ok),
    }


def _sample_of(result: Findings) -> Sample | None:
    """The chains of mcmc; None of another method."""
    if not result.files:
        return None
    from ifrfit.inference.mcmc import Sample

    return next((file for file in result.files.values() if isinstance(file, Sample)), None)


def _independent(result: Findings, allowed: int) -> tuple[dict[str, Array], dict[str, Any]]:
    """Independent draws, so many a chain as the log likelihood allows."""
    each = max(1, allowed // _CHAINS)
    each = min(each, _DRAWS)
    drawn = result.distribution.draws(_CHAINS * each, np.random.default_rng(result.seed))
    draws = {name: values.reshape(_CHAINS, each) for name, values in drawn.items()}
    is_sampled = isinstance(result.distribution, ImportancePosterior)
    source = "resampled from importance sampling" if is_sampled else "independent draws from a quadrature"
    return draws, {"sampler": source}


def _of_chains(sample: Sample, allowed: int) -> tuple[dict[str, Array], dict[str, Any]]:
    """A chain an ensemble: the draws of its walkers in the order of time, thinned until they are independent.

    Not thinned, they would look independent to estimators of effective size although they are not, because
    the draws of one walker lie far apart in such a row.
    """
    evidence = sample.evidence
    longest = max(evidence.tau.values())
    ensembles, steps, walkers = next(iter(evidence.kept.values())).shape
    few = math.ceil(steps * ensembles * walkers / allowed)
    thin = max(few, math.ceil(_INDEPENDENT * longest) if math.isfinite(longest) else 1)
    draws = {name: x[:, ::thin].reshape(ensembles, -1) for name, x in evidence.kept.items()}
    return draws, {
        "sampler": "emcee",
        "ensembles": ensembles,
        "walkers": walkers,
        "steps": evidence.steps,
        "discarded": evidence.discarded,
        "thinned": thin,
        "autocorrelation_time": longest,
        "acceptance": sample.chains.acceptance,
    }
