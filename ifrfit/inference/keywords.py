"""The keywords of `fit` and its relatives: shortcuts for the fields of `Model`, `Noise` and the methods."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

from ifrfit.errors import UsageError
from ifrfit.inference.estimators import ESTIMATORS, Estimator, make_estimator, method_options
from ifrfit.inference.option_fields import build, given, options_of
from ifrfit.inference.options import Model, Noise, Range

if TYPE_CHECKING:
    from ifrfit.data import Selection

# of the options of noise and methods those whose keyword is no shortcut that will go
_STAYS = ("noise", "angle_offset")


class DataKeywords(TypedDict, total=False):
    """Which rows are used, and how columns are meant."""

    observable: str | Sequence[str]
    series: str | Sequence[str]
    gamma_min: float | None
    gamma_max: float | None
    speed_min: float | None
    speed_max: float | None
    exclude: str | int | Sequence[str | int]
    independent: bool
    convention: Sequence[str] | Mapping[str, str]


class NoiseKeywords(TypedDict, total=False):
    """Shortcuts for fields of `Noise`; deprecated, but for the angle offset."""

    tails: str
    dof: float | None
    angle_errors: str
    angle_population: Range | None
    sigma_gamma: float | None
    sigma_velocity: float | None
    sigma_spin: float | None
    angle_offset: float | None


class ConstantKeywords(TypedDict, total=False):
    """Shortcuts for fields of `Model` but for the closure; and `params`, in lmfit's form."""

    fix: Mapping[str, float] | None
    prior: Mapping[str, Range] | None
    bounds: Mapping[str, Range] | None
    separate: str | Collection[str]
    inertia_factor: float | None
    params: Any


class MethodKeywords(TypedDict, total=False):
    """Shortcuts for fields of the methods; deprecated."""

    accuracy: float | None
    budget: float | str | None
    max_steps: int | None
    resume: str | Path | None
    resample: str | None
    replicates: int | None
    workers: int


class QuestionKeywords(DataKeywords, ConstantKeywords, NoiseKeywords, total=False):
    """Keywords of `compare`."""


class CostKeywords(QuestionKeywords, total=False):
    """Keywords of `measure_costs`."""

    closure: str


class FitKeywords(CostKeywords, MethodKeywords, total=False):
    """Keywords of `fit`."""


def check_keywords(function: str, allowed: type, keywords: Mapping[str, object]) -> None:
    """Refuse keywords that a function does not have, and warn of those that will go.

    Parameters
    ----------
    function : str
        Its name.
    allowed : type
        One of the typed dictionaries of this module.
    keywords : mapping

    Raises
    ------
    TypeError
        As Python does.
    """
    for keyword in keywords:
        if keyword not in allowed.__annotations__:
            raise TypeError(f"{function}() got an unexpected keyword argument '{keyword}'")
    for keyword, remedy in deprecated().items():
        if keyword in keywords:
            warnings.warn(
                f"The keyword {keyword} of {function} will go in the next release: write {remedy}.",
                DeprecationWarning,
                stacklevel=3,
            )


def deprecated() -> dict[str, str]:
    """Keywords that objects replace, and what to write in their place."""
    found = {
        keyword: f"noise={each.written}"
        for keyword, each in options_of(Noise).items()
        if keyword not in _STAYS
    }
    for estimator in ESTIMATORS.values():
        for keyword, each in options_of(type(estimator)).items():
            if keyword in MethodKeywords.__annotations__:  # what came later never was a keyword
                found[keyword] = f"{found[keyword]} or " if keyword in found else "method="
                found[keyword] += each.written
    return found


def model_of(model: Model | None, keywords: Mapping[str, Any]) -> Model:
    """The model of an object or of keywords.

    Raises
    ------
    UsageError
        If both say something, and as `Model`.
    """
    params = keywords.get("params")
    if model is not None:
        said = given(Model, keywords) | ({} if params is None else {"params": params})
        _refuse_object_and_keywords("model", Model, said)
        return model
    if params is None:
        return build(Model, keywords)
    from ifrfit.inference.io.lmfit import constants_from

    theirs = {key: value | dict(keywords.get(key) or {}) for key, value in constants_from(params).items()}
    return build(Model, {**keywords, **theirs})


def noise_of(noise: str | Noise | None, keywords: Mapping[str, Any]) -> Noise:
    """The noise of an object, or of a policy and keywords.

    Raises
    ------
    UsageError
        If an object and a keyword both say something, and as `Noise`.
    """
    if isinstance(noise, Noise):
        _refuse_object_and_keywords("noise", Noise, given(Noise, keywords))
        return noise
    return build(Noise, {**keywords, "noise": noise})


def estimator_of(method: str | Estimator | None, keywords: Mapping[str, Any]) -> Estimator:
    """The estimator of an object, or of a name and keywords.

    Raises
    ------
    UsageError
        If an object and a keyword both say something, and as `make_estimator`.
    """
    if method is None or isinstance(method, str):
        return make_estimator(method, keywords)
    if isinstance(method, type) or not isinstance(method, Estimator):
        raise UsageError(
            f"method: {method!r} is no method. Give a name, or an object as ifrfit.Exact() or ifrfit.MCMC()."
        )
    options = method_options()
    said = {key: value for key, value in keywords.items() if key in options and options[key].is_given(value)}
    _refuse_object_and_keywords("method", type(method), said)
    return method


def selection_of(keywords: Mapping[str, Any]) -> Selection:
    """Which rows are used."""
    from ifrfit.data import Selection

    said = {each.name: keywords[each.name] for each in fields(Selection) if each.name in keywords}
    for name in ("observable", "series", "exclude"):
        value = said.get(name) or ()
        said[name] = (value,) if isinstance(value, str | int) else tuple(value)
    said["exclude"] = tuple(str(each) for each in said["exclude"])
    return Selection(**said)


def _refuse_object_and_keywords(argument: str, owner: type, said: Mapping[str, object]) -> None:
    if not said:
        return
    names = ", ".join(said)
    raise UsageError(
        f"{argument}={owner.__name__}(...) and {names} both say something of the {argument}: put everything "
        "into the object, or leave the object out."
    )
