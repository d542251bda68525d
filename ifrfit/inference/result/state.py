"""What a result keeps of its distribution: medians and draws, or the Gaussian about the optimum."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.distributions.coordinates import to_parameters
from ifrfit.inference.distributions.draws import Draws
from ifrfit.inference.distributions.protocol import Distribution
from ifrfit.inference.distributions.truncated_gaussian import TruncatedGaussian
from ifrfit.inference.distributions.truncated_normal import TruncatedNormal
from ifrfit.inference.model.entry_names import entry_name, name_in, split_name
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.result.types import State

Array = NDArray[np.float64]


def state_of(
    problem: Problem,
    gaussian: TruncatedGaussian,
    distribution: Distribution,
    drawn: Mapping[str, Array] | None,
) -> State:
    """State for predictions: the Gaussian, or medians of the distribution and draws that stand for it.

    Parameters
    ----------
    problem : Problem
    gaussian : TruncatedGaussian
    distribution : Distribution
    drawn : mapping of str to ndarray, (n,), or None
        Draws of the distribution; None where the Gaussian is to stand, as it does where nothing is free.
    """
    if not drawn:
        return gaussian.state
    names, point = gaussian.state.names, gaussian.state.point.copy()
    sample = to_coordinates(problem, drawn)
    for i, name in enumerate(names):
        kind, series = split_name(name)
        own = name_in(distribution.names, kind, series) if kind == "kappa" else name
        if own in distribution.names:
            point[i] = float(distribution.quantile(own, 0.5))
        elif sample.shape[0]:  # a fixed entry is the same in all
            point[i] = sample[0, i]
    return replace(gaussian.state, point=point, sample=sample)


def to_coordinates(problem: Problem, drawn: Mapping[str, Array]) -> Array:
    """Draws of all entries of theta, (n, p), with kappa in the place of mu where it can stand there."""
    n = next((values.size for values in drawn.values()), 0)
    parameters = problem.parameters
    columns = [
        drawn[name] if name in drawn else np.full(n, entry.fixed)
        for name, entry in zip(parameters.names, parameters.entries, strict=True)
    ]
    sample = np.column_stack(columns)
    for mu, e_n in parameters.kappa_places:
        sample[:, mu] *= 1.0 + sample[:, e_n]
    return sample


def distribution_of(state: State) -> Draws | TruncatedGaussian:
    """The distribution that a state stands for: its draws, or its Gaussian.

    Marginals of the Gaussian are normal: how few rows the noise came from is not kept, nor the transition.
    """
    if state.sample is not None:
        values = to_parameters(state.names, state.sample)
        return Draws({name: x for name, x in values.items() if x.min() < x.max()})
    marginals, loadings = {}, {}
    for name, value in to_parameters(state.names, state.point[None]).items():
        loading = _loading(state, name)
        sd = math.sqrt(float(loading @ state.covariance @ loading))
        if sd > 0.0:
            loadings[name] = loading
            place = int(np.argmax(np.abs(loading)))
            scale = float(loading[place])
            low, high = scale * float(state.lower[place]), scale * float(state.upper[place])
            center = float(value[0])
            if _on_bound(
                state, place
            ):  # elsewhere it is the optimum; the common centre is that of no marginal
                center += scale * float(state.center[place] - state.point[place])
            marginals[name] = TruncatedNormal(float(value[0]), center, sd, low, high)
    return TruncatedGaussian(marginals, loadings, state)


def _on_bound(state: State, place: int) -> bool:
    """Whether a coordinate of the optimum lies on a bound, as the gradient of a state counts it."""
    value = float(state.point[place])
    return value - float(state.lower[place]) <= 1e-9 or float(state.upper[place]) - value <= 1e-9


def _loading(state: State, name: str) -> Array:
    """Derivative of a parameter, or of kappa, by the coordinates of a state."""
    kind, series = split_name(name)
    names, point = state.names, state.point
    loading = np.zeros(len(names))
    if name in names:
        loading[names.index(name)] = 1.0
        return loading
    i_e = names.index(name_in(names, "e_n", series))
    factor = 1.0 + float(point[i_e])
    if kind == "mu":
        i = names.index(entry_name("kappa", series))
        loading[i], loading[i_e] = 1.0 / factor, -float(point[i]) / factor**2
    else:  # kappa where one mu goes with several e_n
        i = names.index("mu")
        loading[i], loading[i_e] = factor, float(point[i])
    return loading
