"""Draws from a result's distribution, and curves with bands made of them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.errors import UsageError
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure
from ifrfit.physics.observables import Observable, get_observable
from ifrfit.physics.rebound import rebound_of

if TYPE_CHECKING:
    import pandas as pd

    from ifrfit.inference.result.fit_result import FitResult
    from ifrfit.inference.result.types import State

Array = NDArray[np.float64]

_SWEEPS = 40  # of Gibbs sampling per draw; each draw is a chain of its own, so draws are independent
_DRAWS = 2000
_AT_ONCE = 500  # incidences
_QUANTILES = (0.16, 0.84, 0.025, 0.975)


def draw(result: FitResult, n: int, rng: np.random.Generator) -> pd.DataFrame:
    """Draw constants; see `FitResult.draws`."""
    import pandas as pd

    state = result.state
    phi = _phi(result, n, rng)
    columns = {}
    for name, column in zip(state.names, phi.T, strict=True):
        kind, bracket = _split(name)
        columns[name] = column
        if kind == "kappa":
            e_n = phi[:, state.names.index(_own(state.names, "e_n", bracket))]
            columns[f"mu{bracket}"] = column / (1.0 + e_n)
    order = sorted(columns, key=lambda name: _split(name)[0] == "kappa")
    return pd.DataFrame({name: columns[name] for name in order})


def _phi(result: FitResult, n: int, rng: np.random.Generator) -> Array:
    """Draws in the coordinates of the state, (n, p): of the law where there is one."""
    state = result.state
    if result.law is not None:
        from ifrfit.inference.summary.distribution_estimates import in_state_coordinates

        return in_state_coordinates(result.problem, result.law.draws(n, rng), n)[1]
    if state.sample is not None:
        kept = state.sample.shape[0]
        return np.asarray(state.sample[rng.choice(kept, n, replace=n > kept)])
    return truncated_normal(state, n, rng)


def truncated_normal(state: State, n: int, rng: np.random.Generator) -> Array:
    """Draws of the local Gaussian cut at the bounds, (n, p), by Gibbs sampling.

    Each coordinate in turn is drawn given the others; entries without variance stay put.
    """
    from scipy.special import ndtr, ndtri

    free = np.flatnonzero(np.diag(state.covariance) > 0.0)
    phi = np.tile(state.point, (n, 1))
    if free.size == 0:
        return phi
    cov = state.covariance[np.ix_(free, free)]
    size = np.sqrt(np.diag(cov))
    precision = np.linalg.pinv(cov / np.outer(size, size), hermitian=True)
    low = (state.lower[free] - state.center[free]) / size
    high = (state.upper[free] - state.center[free]) / size
    z = np.tile(np.clip((state.point[free] - state.center[free]) / size, low, high), (n, 1))
    for _ in range(_SWEEPS):
        for i in range(free.size):
            sd = 1.0 / math.sqrt(precision[i, i])
            mean = z[:, i] - (z @ precision[i]) / precision[i, i]
            a, b = (low[i] - mean) / sd, (high[i] - mean) / sd
            flip = a > 0.0  # take the tail in which probabilities keep their digits
            a, b = np.where(flip, -b, a), np.where(flip, -a, b)
            below, above = ndtr(a), ndtr(b)
            x = np.clip(ndtri(below + rng.random(n) * (above - below)), a, b)
            z[:, i] = mean + sd * np.where(flip, -x, x)
    phi[:, free] = np.clip(state.center[free] + size * z, state.lower[free], state.upper[free])
    return phi


def predict(
    result: FitResult,
    gamma: ArrayLike,
    spin_x: ArrayLike,
    spin_y: ArrayLike,
    *,
    observable: str,
    series: str | None,
    degrees: bool,
    sigma: ArrayLike | None = None,
    bands: bool = True,
) -> pd.DataFrame:
    """Predict; see `FitResult.predict`."""
    import pandas as pd

    wanted = get_observable(observable)
    gamma, s_x, s_y = np.broadcast_arrays(
        np.atleast_1d(np.asarray(gamma, dtype=float)), np.asarray(spin_x, float), np.asarray(spin_y, float)
    )
    incidence = Incidence.of(gamma, s_x, s_y, degrees=degrees)
    bracket = _bracket(result, series)
    table = {
        "gamma_deg": gamma if degrees else np.degrees(gamma),
        "spin_x": s_x,
        "spin_y": s_y,
        "value": _curves(result, wanted, incidence, result.state.point[None], bracket)[0],
    }
    if not bands:
        return pd.DataFrame(table)
    rng = np.random.default_rng(result.seed)
    sample = result.state.sample
    if sample is None:
        sample = truncated_normal(result.state, _DRAWS, rng)
    curves = _curves(result, wanted, incidence, sample, bracket)
    band = np.quantile(curves, _QUANTILES, axis=0)
    # where a bound holds the optimum back the curve runs along the edge of its band, never outside
    band[[0, 2]] = np.minimum(band[[0, 2]], table["value"])
    band[[1, 3]] = np.maximum(band[[1, 3]], table["value"])
    own = np.asarray(_sigma(result, observable, series) if sigma is None else sigma, dtype=float)
    table |= dict(zip(("lo68", "hi68", "lo95", "hi95"), band, strict=True))
    dof = result.noise.error_model.dof
    shape = (sample.shape[0], 1)
    noise = own * (rng.standard_normal(shape) if dof is None else rng.standard_t(dof, shape))
    new = np.quantile(curves + noise, _QUANTILES, axis=0)
    table |= dict(zip(("new_lo68", "new_hi68", "new_lo95", "new_hi95"), new, strict=True))
    return pd.DataFrame(table)


def _curves(
    result: FitResult, observable: Observable, incidence: Incidence, phi: Array, bracket: str
) -> Array:
    """The observable at each incidence, by each row of constants, (rows, incidences)."""
    closure = get_closure(result.closure)
    e_n, c, mu = _constants(result.state, phi, closure.constant, bracket)
    curves = np.empty((phi.shape[0], incidence.sine.size))
    for block in np.array_split(np.arange(incidence.sine.size), max(1, incidence.sine.size // _AT_ONCE)):
        part = Incidence(
            *(
                getattr(incidence, f)[block]
                for f in ("sine", "cosine", "spin_x", "spin_y", "slip_x", "slip_y")
            )
        )
        state = rebound_of(part, closure, e_n[:, None], c[:, None], mu[:, None], result.inertia_factor)
        curves[:, block] = observable.value(state, mu[:, None])
    return curves


def _split(name: str) -> tuple[str, str]:
    kind, _, rest = name.partition("[")
    return kind, f"[{rest}" if rest else ""


def _own(names: tuple[str, ...], kind: str, bracket: str) -> str:
    return f"{kind}{bracket}" if f"{kind}{bracket}" in names else kind


def _bracket(result: FitResult, series: str | None) -> str:
    """Label of a series' own constants; refuses a missing choice and an unknown series."""
    brackets = dict.fromkeys(_split(name)[1] for name in result.state.names)
    labels = [b[1:-1] for b in brackets if b]
    if series is None:
        if labels:
            raise UsageError(f"Constants are separate by series: name one of {', '.join(labels)}.")
        return ""
    if labels and series not in labels:
        raise UsageError(f"There is no series '{series}'. Choose one of {', '.join(labels)}.")
    return f"[{series}]" if labels else ""


def _constants(state: State, phi: Array, own: str | None, bracket: str) -> tuple[Array, Array, Array]:
    names = state.names
    e_n = phi[:, names.index(_own(names, "e_n", bracket))]
    c = phi[:, names.index(_own(names, own, bracket))] if own else np.zeros(phi.shape[0])
    for kind, factor in (("kappa", 1.0 / (1.0 + e_n)), ("mu", np.ones(phi.shape[0]))):
        name = _own(names, kind, bracket)
        if name in names:
            return e_n, c, phi[:, names.index(name)] * factor
    raise UsageError("The result holds no friction.")


def _sigma(result: FitResult, observable: str, series: str | None) -> float:
    """Noise of one more measurement: of this series if it has any, else the mean over series; nan without."""
    sigma = result.noise.sigma
    if series is not None and f"{series}/{observable}" in sigma:
        return sigma[f"{series}/{observable}"]
    own = [value for key, value in sigma.items() if key.rpartition("/")[2] == observable]
    return float(np.sqrt(np.mean(np.square(own)))) if own else math.nan
