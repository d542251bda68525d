"""The parts of result.json, checked by hand and turned into values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from ifrfit.data import Descriptor, Source
from ifrfit.data.observations import TABLE_COLUMNS, TEXT_COLUMNS
from ifrfit.inference.accuracy.types import Effort
from ifrfit.inference.io.json_node import Node
from ifrfit.inference.io.write_result import FACTOR
from ifrfit.inference.model.error_model import PLAIN, ErrorModel, make_error_model
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.result.types import Estimate, Fact, FitStatistics, Noise, State, Status

if TYPE_CHECKING:
    import pandas as pd

_STATISTICS_OR_NULL = ("reduced_chi2", "p_value", "log_evidence")
_COUNTS = ("n", "n_sliding", "n_sticking", "rank", "dof")
_COUNT_COLUMNS = ("n_repeats", "row")
_POINT_COLUMNS = (*TABLE_COLUMNS, "sigma_used", "fitted", "residual", "standardised", "tau", "sticking")


def effort_from(node: Node) -> Effort:
    """The effort of a result."""
    steps = node["steps"]
    return Effort(
        method=node["method"].text(),
        steps=None if steps.value is None else steps.whole(),
        seconds=node["seconds"].number(),
        why=node["why"].text(),
        **{key: node[key].maybe() for key in ("accuracy", "budget", "tolerance", "reached")},
    )


def source_from(node: Node) -> Source:
    """The source of a result."""
    described = node.value.get("descriptor") if isinstance(node.value, dict) else None
    return Source(
        name=node["name"].text(),
        sha256=node["sha256"].text(),
        rows=node["rows"].whole(),
        rows_used=node["rows_used"].whole(),
        rows_skipped=node["rows_skipped"].mapped(lambda count: count.whole()),
        provenance=node["provenance"].text(),
        selection=node["selection"].text(),
        descriptor=None if described is None else _descriptor(node["descriptor"]),
    )


def _descriptor(node: Node) -> Descriptor:
    def texts(key: str) -> tuple[str, ...]:
        return tuple(node[key].each(lambda item: item.text()))

    conditions = node["conditions"]
    conditions.check(dict)
    noise = node["noise"]
    return Descriptor(
        name=node["name"].text(),
        title=node["title"].text(),
        provenance=node["provenance"].text(),
        conditions=dict(conditions.value),
        default_observables=texts("default_observables"),
        default_series=texts("default_series"),
        noise=None if noise.value is None else noise.text(),
        faces=tuple(node["faces"].each(lambda group: tuple(group.each(lambda item: item.text())))),
        inertia_factor=node["inertia_factor"].number(),
        assumptions=texts("assumptions"),
        printed_constants=node["printed_constants"].mapped(lambda item: item.number()),
        licence=node["licence"].text(),
        source=node["source"].text(),
    )


def noise_from(node: Node) -> Noise:
    """The noise of a result."""

    def named(found: dict[str, Any]) -> dict[str, Any]:
        return {"" if name == FACTOR else name: item for name, item in found.items()}

    return Noise(
        policy=node["policy"].text(),
        sigma=node["sigma"].mapped(lambda item: item.number(math.nan)),
        estimates=named(node["estimates"].mapped(_estimate)) if "estimates" in node else {},
        prior=named(node["prior"].mapped(_interval)) if "prior" in node else {},
        error_model=_error_model(node["scatter"]) if "scatter" in node else PLAIN,
    )


def _error_model(node: Node) -> ErrorModel:
    population = node["angle_population"]
    return make_error_model(
        tails=node["tails"].text(),
        angle_errors=node["angle_errors"].text(),
        angle_population=None if population.value is None else _interval(population),
        **{key: node[key].maybe() for key in ("dof", "sigma_gamma", "sigma_velocity", "sigma_spin")},
    )


def asked_from(node: Node) -> tuple[Parameter, ...]:
    """The asked of a result."""
    node.check(dict)
    return tuple(_constant_asked(name, node[name]) for name in node.value)


def _constant_asked(name: str, node: Node) -> Parameter:
    low, high = _interval(node["bounds"])
    prior = node["prior"]
    separate = node["separate"]
    separate.check(bool)
    return Parameter(
        name=name,
        lower=low,
        upper=high,
        fixed=node["fixed"].maybe(),
        prior=None if prior.value is None else (float(prior.array(2)[0]), float(prior.array(2)[1])),
        separate=bool(separate.value),
    )


def _estimate(node: Node) -> Estimate:
    status = node["status"]
    if status.value not in get_args(Status):
        status.fail(f"one of {', '.join(get_args(Status))}")
    return Estimate(
        value=node["value"].maybe(),
        stderr=node["stderr"].maybe(),
        interval68=_interval(node["interval68"]),
        interval95=_interval(node["interval95"]),
        status=status.value,
        reason=node["reason"].text() if "reason" in node else "",
        mean=node["mean"].maybe() if "mean" in node else None,
    )


def _interval(node: Node) -> tuple[float, float]:
    node.check(list)
    if len(node.value) != 2:
        node.fail("a list of two numbers or null")
    nulls = iter((-math.inf, math.inf))
    low, high = node.each(lambda end: end.number(next(nulls)))
    return low, high


def _is_estimate(value: Any) -> bool:
    """Tell an estimate from a mapping of series to estimates, whatever the series are called."""
    nested = (Mapping, list, type(None))
    return isinstance(value, Mapping) and not all(isinstance(item, nested) for item in value.values())


def constant_from(node: Node) -> Estimate | dict[str, Estimate]:
    """The constant of a result."""
    node.check(dict)
    return _estimate(node) if _is_estimate(node.value) else node.mapped(_estimate)


def derived_from(node: Node) -> Any:
    """The derived of a result."""
    if node.value is None:
        return None
    if isinstance(node.value, list):
        return tuple(node.each(_estimate))
    node.check(dict)
    return _estimate(node) if _is_estimate(node.value) else node.mapped(derived_from)


def statistics_from(node: Node) -> FitStatistics:
    """The statistics of a result."""
    values: dict[str, Any] = {}
    for field in fields(FitStatistics):
        item = node[field.name]
        if field.name in _COUNTS:
            values[field.name] = item.whole()
        elif field.name in _STATISTICS_OR_NULL:
            values[field.name] = item.maybe()
        else:
            values[field.name] = item.number(math.nan)
    return FitStatistics(**values)


def fact_from(node: Node) -> Fact:
    """The fact of a result."""
    ok = node["ok"]
    ok.check(bool)
    figures = node["figures"]
    figures.check(dict)
    return Fact(bool(ok.value), node["says"].text(), dict(figures.value), node["threshold"].text())


def state_from(node: Node) -> State:
    """The state of a result."""
    names = tuple(node["names"].each(lambda item: item.text()))
    n = len(names)
    return State(
        names=names,
        point=node["point"].array(n),
        center=node["center"].array(n),
        covariance=node["covariance"].square(n),
        lower=node["lower"].array(n, -math.inf),
        upper=node["upper"].array(n, math.inf),
        sample=_sample(node["sample"], names) if "sample" in node else None,
    )


def _sample(node: Node, names: tuple[str, ...]) -> Any:
    """Draws of the posterior, (n, names), from one list a name."""
    columns = [node[name].finite() for name in names]
    lengths = [len(column) for column in columns]
    if not columns or min(lengths) == 0:
        node.fail("an object of lists that are not empty")
    for name, length in zip(names, lengths, strict=True):
        if length != lengths[0]:
            node[name].fail(f"as long as {node.path}.{names[0]} ({lengths[0]})")
    sample = np.column_stack(columns)
    sample.flags.writeable = False
    return sample


def points_from(node: Node) -> pd.DataFrame:
    """The table of rows used; without rows where the file does not keep them."""
    import pandas as pd

    given = {name: Node([], name, node.file) for name in _POINT_COLUMNS}
    if node.value is not None:
        given = {name: node[name] for name in dict.fromkeys((*_POINT_COLUMNS, *node.value))}
    columns = {name: _column(name, column) for name, column in given.items()}
    lengths = {name: len(column) for name, column in columns.items()}
    for name, length in lengths.items():
        if length != lengths["value"]:
            given[name].fail(f"as long as points.value ({lengths['value']})")
    table = pd.DataFrame(columns)
    for name in TEXT_COLUMNS:
        table[name] = table[name].astype("str")
    # the slip ratio at grazing incidence: infinite, which JSON does not know
    table.loc[table["tau"].isna() & table["gamma_deg"].notna(), "tau"] = math.inf
    return table


def _column(name: str, node: Node) -> Any:
    """One column; the kinds of its cells are looked at together, cell by cell only to name a wrong one."""
    import pandas as pd

    node.check(list)
    kinds = set(map(type, node.value))
    if name in TEXT_COLUMNS:
        if not kinds <= {str}:
            node.each(lambda cell: cell.text())
        return pd.Series(node.value, dtype=object)
    if name in _COUNT_COLUMNS:
        if not kinds <= {int}:
            node.each(lambda cell: cell.whole())
        return pd.Series(node.value, dtype="int64")
    if name == "sticking" or kinds == {bool}:
        if not kinds <= {bool, type(None)}:
            node.each(lambda cell: cell.check(bool) if cell.value is not None else None)
        return pd.Series(node.value, dtype=object if type(None) in kinds else bool)
    if not kinds <= {int, float, type(None)}:
        node.each(lambda cell: cell.number(math.nan))
    return pd.Series(node.value, dtype=float)
