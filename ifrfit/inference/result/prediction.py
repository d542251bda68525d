"""Draws from a result's distribution, and curves with bands made of them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.errors import UsageError
from ifrfit.inference.distributions.coordinates import to_parameters
from ifrfit.inference.distributions.protocol import BANDS
from ifrfit.inference.distributions.truncated_gaussian import truncated_draws
from ifrfit.inference.model.entry_names import name_in, split_name
from ifrfit.inference.result.state import to_coordinates
from ifrfit.physics.angles import Incidence, check_incidence, real_array
from ifrfit.physics.closures import get_closure
from ifrfit.physics.observable import Observable
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.rebound import rebound_of
from ifrfit.physics.transition import transition_angles

if TYPE_CHECKING:
    import pandas as pd

    from ifrfit.inference.result.findings import Findings
    from ifrfit.inference.result.types import State

Array = NDArray[np.float64]

_DRAWS = 2000
_AT_ONCE = 500  # incidences
_QUANTILES = tuple(BANDS.values())
_MOST_FRICTION = 2.0  # in mu: apparent friction above which more than half of it is not Coulomb's


def draw(result: Findings, n: int, rng: np.random.Generator) -> pd.DataFrame:
    """Draw constants; see `FitResult.draws`."""
    _check_draws(n, rng)
    if result.problem is None or result.state.sample is None:
        return draw_kept(result, n, rng)
    return _table(result.state.names, to_coordinates(result.problem, result.distribution.draws(n, rng)))


def _check_draws(n: object, rng: object) -> None:
    """Refuse what is no number of draws, or draws nothing."""
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or int(n) < 0:
        raise UsageError(f"{n!r} draws: it must be a whole number, 0 or more.")
    if not isinstance(rng, np.random.Generator):
        hint = f"numpy.random.default_rng({rng if isinstance(rng, int) else ''})"
        raise UsageError(f"rng: {rng!r:.40} draws nothing. Give a Generator, as {hint}.")


def draw_kept(result: Findings, n: int, rng: np.random.Generator) -> pd.DataFrame:
    """Draw from what a result keeps in its file: its 2,000 draws, or the Gaussian about the optimum."""
    state = result.state
    if state.sample is None:
        return _table(state.names, truncated_draws(state, n, rng))
    kept = state.sample.shape[0]
    return _table(state.names, state.sample[rng.choice(kept, n, replace=n > kept)])


def _table(names: tuple[str, ...], phi: Array) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(to_parameters(names, phi))


def predict(
    result: Findings,
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

    wanted = OBSERVABLES[observable]
    gamma, s_x, s_y = _conditions(gamma, spin_x, spin_y)
    check_incidence(gamma, degrees=degrees)
    incidence = Incidence.of(gamma, s_x, s_y, degrees=degrees)
    own_series = _series_of(result, series)
    table = {
        "gamma_deg": gamma if degrees else np.degrees(gamma),
        "spin_x": s_x,
        "spin_y": s_y,
        "value": _curves(result, wanted, incidence, result.state.point[None], own_series)[0],
    }
    if bands:
        rng = np.random.default_rng(result.seed)
        sample = result.state.sample
        if sample is None:
            sample = truncated_draws(result.state, _DRAWS, rng)
        curves = _curves(result, wanted, incidence, sample, own_series)
        band = np.quantile(curves, _QUANTILES, axis=0)
        # where a bound holds the optimum back the curve runs along the edge of its band, never outside
        band[[0, 2]] = np.minimum(band[[0, 2]], table["value"])
        band[[1, 3]] = np.maximum(band[[1, 3]], table["value"])
        own = real_array("sigma", _sigma(result, observable, series) if sigma is None else sigma)
        if own.shape not in ((), (1,), gamma.shape):
            raise UsageError(
                f"sigma: has shape {own.shape}. Give one number, or one for each of {gamma.size} angles."
            )
        error_model = result.noise.error_model
        noise = own * error_model.law.draw(rng, (sample.shape[0], 1), error_model.dof)
        new = np.quantile(curves + noise, _QUANTILES, axis=0)
        table |= dict(zip((*BANDS, *(f"new_{end}" for end in BANDS)), (*band, *new), strict=True))
    frame = pd.DataFrame(table)
    frame.attrs["warnings"] = tuple(filter(None, [_excess_friction(result, incidence, own_series)]))
    return frame


def _conditions(gamma: ArrayLike, spin_x: ArrayLike, spin_y: ArrayLike) -> tuple[Array, Array, Array]:
    """Conditions of impacts, finite and as long as one another."""
    given = {"gamma": gamma, "spin_x": spin_x, "spin_y": spin_y}
    arrays = {name: real_array(name, value) for name, value in given.items()}
    for name, array in arrays.items():
        if array.ndim > 1:
            raise UsageError(f"{name}: has {array.ndim} dimensions. Give one value for each impact.")
        if not np.isfinite(array).all():
            raise UsageError(
                f"{name} {array[~np.isfinite(array)].flat[0]:g}: there is no such impact. Leave it out."
            )
    try:
        gamma, s_x, s_y = np.broadcast_arrays(
            np.atleast_1d(arrays["gamma"]), arrays["spin_x"], arrays["spin_y"]
        )
    except ValueError:
        raise UsageError(
            "gamma, spin_x and spin_y: give numbers, or arrays of numbers that are as long as one another."
        ) from None
    return gamma, s_x, s_y


def kinks_of(result: Findings, series: str, spin_x: float = 0.0, spin_y: float = 0.0) -> tuple[float, ...]:
    """Incidence angles in degrees at which the predicted curve passes from sticking to sliding, or back.

    Parameters
    ----------
    result : Findings
    series : str
    spin_x, spin_y : float
        R omega/u before.
    """
    closure = get_closure(result.closure)
    point = _constants(result.state, result.state.point[None], closure.constant, _series_of(result, series))
    e_n, c, mu = (part[0] for part in point)
    with np.errstate(divide="ignore", invalid="ignore"):
        tau = float(mu * (1.0 + e_n) / closure.law(result.inertia_factor).bound(c))
    return transition_angles(tau, spin_x, spin_y) if math.isfinite(tau) else ()


def _excess_friction(result: Findings, incidence: Incidence, series: str) -> str:
    """Where the apparent friction exceeds 2 mu; empty where it does not.

    Sliding under IFR has an impulse a |U_t| beside Coulomb's kappa U_n, with a = (1 + e_t) J/(1 + J), and so
    an apparent friction of mu (1 + a tau/kappa): the first part has outgrown the second where that is above
    2 mu. No bound of friction holds it.
    """
    closure = get_closure(result.closure)
    point = _constants(result.state, result.state.point[None], closure.constant, series)
    e_n, c, mu = (part[0] for part in point)
    friction = rebound_of(incidence, closure, e_n, c, mu, result.inertia_factor).mu_app_magnitude
    above = friction > _MOST_FRICTION * mu  # not where it is nan, without an approach
    if not above.any():
        return ""
    worst = float(friction[above].max())
    times = f" ({worst / mu:.3g} mu)" if mu > 0.0 else ""
    return (
        f"The apparent friction exceeds 2 mu at {np.count_nonzero(above)} of {above.size} incidences and is "
        f"{worst:.3g}{times} at the worst: sliding under closure {closure.title} has an impulse that grows "
        "with the slip beside Coulomb's friction. Do not rely on it so near to grazing, or with such a spin; "
        "closure FR has no such part."
    )


def _curves(result: Findings, observable: Observable, incidence: Incidence, phi: Array, series: str) -> Array:
    """The observable at each incidence, by each row of constants, (rows, incidences)."""
    closure = get_closure(result.closure)
    e_n, c, mu = _constants(result.state, phi, closure.constant, series)
    curves = np.empty((phi.shape[0], incidence.sine.size))
    for block in np.array_split(np.arange(incidence.sine.size), max(1, incidence.sine.size // _AT_ONCE)):
        part = incidence.take(block)
        state = rebound_of(part, closure, e_n[:, None], c[:, None], mu[:, None], result.inertia_factor)
        curves[:, block] = observable.value(state, mu[:, None])
    return curves


def _series_of(result: Findings, series: str | None) -> str:
    """Series whose constants to take, empty where all share them; refuses no choice or an unknown one."""
    labels = [own for own in dict.fromkeys(split_name(name)[1] for name in result.state.names) if own]
    fitted = list(dict.fromkeys(name.rpartition("/")[0] for name in result.noise.sigma))
    if series is None:
        if labels:
            raise UsageError(f"Constants are separate by series: name one of {', '.join(labels)}.")
        return ""
    if series not in fitted:
        raise UsageError(f"There is no series '{series}'. Choose one of {', '.join(fitted)}.")
    return series if labels else ""


def _constants(state: State, phi: Array, own: str | None, series: str) -> tuple[Array, Array, Array]:
    names = state.names
    e_n = phi[:, names.index(name_in(names, "e_n", series))]
    c = phi[:, names.index(name_in(names, own, series))] if own else np.zeros(phi.shape[0])
    for kind, factor in (("kappa", 1.0 / (1.0 + e_n)), ("mu", np.ones(phi.shape[0]))):
        name = name_in(names, kind, series)
        if name in names:
            return e_n, c, phi[:, names.index(name)] * factor
    raise UsageError("The result holds no friction.")


def _sigma(result: Findings, observable: str, series: str | None) -> float:
    """Noise of one more measurement: of this series if it has any, else the mean over series; nan without."""
    sigma = result.noise.sigma
    if series is not None and f"{series}/{observable}" in sigma:
        return sigma[f"{series}/{observable}"]
    own = [value for key, value in sigma.items() if key.rpartition("/")[2] == observable]
    return float(np.sqrt(np.mean(np.square(own)))) if own else math.nan
