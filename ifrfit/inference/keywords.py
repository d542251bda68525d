"""The keywords of `fit` and its relatives: which rows are used, and shortcuts for the fields of `Model`."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypedDict

from ifrfit.errors import UsageError
from ifrfit.inference.estimator import Estimator
from ifrfit.inference.estimators import ESTIMATORS, Exact
from ifrfit.inference.option_fields import build, check_form, given, plain
from ifrfit.inference.options import Model, Noise, Range
from ifrfit.physics.closures import CLOSURES
from ifrfit.text import meant

if TYPE_CHECKING:
    import lmfit
    from numpy.typing import ArrayLike

    from ifrfit.data import Selection
    from ifrfit.inference.model.prior_laws import PriorLaw


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


class ConstantKeywords(TypedDict, total=False):
    """Shortcuts for fields of `Model` but for the closure; and `params`, in lmfit's form."""

    fix: Mapping[str, float] | None
    prior: Mapping[str, Range | PriorLaw] | None
    prior_from: str | None
    bounds: Mapping[str, Range] | None
    separate: str | Collection[str]
    tie: Mapping[str, str] | None
    inertia_factor: float | None
    params: lmfit.Parameters | None


class ColumnKeywords(TypedDict, total=False):
    """Columns in the place of data, as a table would have them; any other name of a column does as well."""

    gamma_deg: ArrayLike
    beta: ArrayLike
    beta_cm: ArrayLike
    e_n: ArrayLike
    mu_app: ArrayLike
    v_x: ArrayLike
    v_n: ArrayLike
    spin_x: ArrayLike
    spin_y: ArrayLike
    spin_y_after: ArrayLike
    speed_m_s: ArrayLike
    sigma: ArrayLike
    sigma_beta: ArrayLike
    sigma_beta_cm: ArrayLike
    sigma_e_n: ArrayLike
    sigma_v_x: ArrayLike
    sigma_v_n: ArrayLike
    sigma_gamma_deg: ArrayLike


class QuestionKeywords(DataKeywords, ConstantKeywords, ColumnKeywords, total=False):
    """Keywords of `compare`."""

    covariance: ArrayLike | None


class FitKeywords(QuestionKeywords, total=False):
    """Keywords of `fit` and of `measure_costs`."""

    closure: str


def check_keywords(function: str, allowed: type, keywords: Mapping[str, object]) -> None:
    """Refuse keywords that a function does not have.

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
    UsageError
        For weights.
    """
    for keyword in keywords:
        if keyword == "weights":
            raise UsageError(
                "weights: some write them for 1/sigma and some for 1/sigma^2. Give sigma itself, with "
                "--noise scaled where only its proportions are known."
            )
        if keyword not in allowed.__annotations__:
            close = meant(keyword, list(allowed.__annotations__))
            raise TypeError(
                f"{function}() got an unexpected keyword argument '{keyword}'.{close}".rstrip(".")
            )


def split_columns(
    function: str, allowed: type, data: Any, keywords: Mapping[str, Any]
) -> tuple[Any, dict[str, Any]]:
    """Data and the other keywords of a function, whose data may have come as columns by keyword.

    Parameters
    ----------
    function : str
        Its name.
    allowed : type
        One of the typed dictionaries of this module.
    data : object
        None where columns are to be the data.
    keywords : mapping

    Raises
    ------
    TypeError
        For a keyword that is neither known nor the name of a column.
    UsageError
        For data and columns, or neither.
    """
    options = allowed.__annotations__.keys() - ColumnKeywords.__annotations__.keys()
    columns = {name: value for name, value in keywords.items() if name not in options}
    if data is not None and not columns:
        return data, dict(keywords)
    from ifrfit.data.column_names import role_of

    check_keywords(function, allowed, {k: v for k, v in columns.items() if role_of(k).kind == "unknown"})
    if data is not None:
        raise UsageError(
            f"{function}(data, {next(iter(columns))}=...): columns are given beside data. Put them into one "
            "table."
        )
    _refuse_labels(function, columns, keywords)
    if not columns:
        raise UsageError(
            "There is nothing to fit: give a file, a dataset's name, a table, or columns by keyword "
            "(gamma_deg=[...], beta=[...])."
        )
    return columns, {name: value for name, value in keywords.items() if name in options}


def _refuse_labels(function: str, columns: Mapping[str, Any], keywords: Mapping[str, Any]) -> None:
    """Refuse a label for each impact by keyword: `series` and `observable` choose among those of a table."""
    for name in ("series", "observable"):
        labels = keywords.get(name)
        if labels is None or isinstance(labels, str) or not hasattr(labels, "__len__"):
            continue
        texts = [str(each) for each in labels]
        if len(set(texts)) < len(texts) or (name == "observable" and "value" in columns):
            rest = ", ".join(f'"{column}": [...]' for column in list(columns)[:2])
            those = "series" if name == "series" else "observables"
            raise UsageError(
                f"{name}=[...] chooses among the {those} of a table, and here stands for a column. Put "
                "columns of this name into a mapping: "
                f'ifrfit.{function}({{"{name}": [...], {rest}}}).'
            )


def _no_model(given: object) -> str:
    """What is said of a second argument that is no Model: data are one argument, the rest goes by keyword."""
    if not isinstance(given, str):
        return (
            f"The second argument is a Model, not {type(given).__name__}: give columns by keyword, "
            "gamma_deg=[...], beta=[...], or together in one table."
        )
    if given in ESTIMATORS:
        return f"model: {given!r} is no Model but a method: say --method {given}."
    if given in CLOSURES:
        return f"model: {given!r} is no Model but a closure: say --closure {given}."
    return (
        f"model: {given!r:.60} is no Model. Name a closure by --closure ifr, a method by --method exact, and "
        "several files or datasets in one list."
    )


def model_of(model: Model | None, keywords: Mapping[str, Any]) -> Model:
    """The model of an object or of keywords.

    Raises
    ------
    UsageError
        If both say something, and as `Model`.
    """
    params = keywords.get("params")
    _refuse_class("model", model, 'Model("ifr")')
    if model is not None and not isinstance(model, Model):
        raise UsageError(_no_model(model))
    if model is not None:
        said = given(Model, keywords) | ({} if params is None else {"params": params})
        if said:
            raise UsageError(
                f"model=Model(...) and {', '.join(said)} both say something of the model: put everything "
                "into the object, or leave the object out."
            )
        return model
    if params is None:
        return build(Model, keywords)
    if not hasattr(params, "valuesdict"):
        raise UsageError(f"params: {params!r:.60} is no lmfit.Parameters.")
    from ifrfit.inference.io.lmfit import constants_from

    theirs = {key: value | dict(keywords.get(key) or {}) for key, value in constants_from(params).items()}
    return build(Model, {**keywords, **theirs})


def _refuse_class(keyword: str, value: object, example: str) -> None:
    """Refuse a class in the place of an object of it."""
    if isinstance(value, type):
        raise UsageError(f"{keyword}: {value.__name__} is a class. Give an object, as ifrfit.{example}.")


def noise_of(noise: str | Noise | None) -> Noise:
    """The noise of an object, or of a policy.

    Raises
    ------
    UsageError
        As `Noise`.
    """
    _refuse_class("noise", noise, 'Noise("unknown")')
    return noise if isinstance(noise, Noise) else Noise(noise)


def estimator_of(method: str | Estimator | None) -> Estimator:
    """The estimator of an object, or of a name: `Exact` where neither is given.

    Raises
    ------
    UsageError
        For an unknown name, and for an object that is no estimator.
    """
    if method is None or isinstance(method, str):
        return ESTIMATORS[method or Exact.name]
    if isinstance(method, type) or not isinstance(method, Estimator):
        raise UsageError(
            f"method: {method!r} is no method. Give a name, or an object as ifrfit.Exact() or ifrfit.MCMC()."
        )
    return method


def selection_of(keywords: Mapping[str, Any]) -> Selection:
    """Which rows are used.

    Raises
    ------
    UsageError
        For a limit that is no number, a name that is no text.
    """
    from ifrfit.data import Selection

    for name in ("gamma_min", "gamma_max", "speed_min", "speed_max"):
        if keywords.get(name) is not None:
            check_form(f"--{name.replace('_', '-')}", "number", keywords[name])
    said = {each.name: plain(keywords[each.name]) for each in fields(Selection) if each.name in keywords}
    for name in ("observable", "series"):
        check_form(f"--{name}", "names", said.get(name) or ())
    for name in ("observable", "series", "exclude"):
        value = said.get(name) or ()
        if not isinstance(value, int | Iterable):
            raise UsageError(
                f"--exclude: {value!r:.60} is neither the name or number of a row nor several of these."
            )
        said[name] = (value,) if isinstance(value, str | int) else tuple(value)
    said["exclude"] = tuple(str(each) for each in said["exclude"])
    return Selection(**said)
