"""A series that reads the impacts of another again is named; series of impacts of their own are not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import at_most, rest_long
from scipy import stats

import ifrfit
from ifrfit.inference.diagnostics import second_readings as room
from ifrfit.inference.fit import fit
from ifrfit.physics import rebound

NOISE = 0.02
FIXED = {"e_n": 0.85}
IFR = {"e_n": 0.85, "e_t": -0.75, "mu": 0.13}


def tables(seed, n, *, shared, observables=("beta",), nominal=False, repeats=1, noise=NOISE, law=IFR, skip=0):
    """Two tables whose errors have a correlation; second readings of the angle are off by 0.2 degrees.

    `nominal`: both are at the same angles. `skip`: the second lacks every so many rows.
    """
    rng = np.random.default_rng([seed, n])
    closure = "ifr" if "e_t" in law else "fr"
    grid = np.repeat(np.linspace(10.0, 80.0, n // repeats), repeats)
    one, other = (grid if nominal else np.sort(np.round(rng.uniform(6.0, 82.0, n), 1)) for _ in range(2))
    if shared:
        other = one
    columns = []
    common = {name: rng.standard_normal(n) for name in observables}
    for gamma in (one, other):
        state = rebound(gamma, closure=closure, degrees=True, **law)
        own = {}
        for name in observables:
            value = np.full(n, law["e_n"]) if name == "e_n" else getattr(state, name)
            errors = np.sqrt(shared) * common[name] + np.sqrt(1.0 - shared) * rng.standard_normal(n)
            own[name] = np.round(value + noise * errors, 4)
        columns.append(own)
    if shared and not nominal:
        other = np.round(other + 0.2 * rng.standard_normal(n), 1)
    second = pd.DataFrame({"gamma": other, **columns[1]})
    if skip:
        second = second.drop(index=range(3, n, skip))
    return {"A": pd.DataFrame({"gamma": one, **columns[0]}), "B": second}


def found(data, **options):
    return fit(data, method="lsq", **{"fix": FIXED, **options})


@pytest.mark.parametrize(
    ("options", "fixed"),
    [
        ({}, FIXED),
        ({"skip": 9}, FIXED),
        ({"nominal": True, "repeats": 5}, FIXED),
        ({"observables": ("beta", "e_n")}, {}),
    ],
)
def test_a_second_reading_is_named(options, fixed):
    """Of 40 impacts, errors alike by 0.9: Student's t is 10 with 33 degrees of freedom, p below 1e-10."""
    for seed in range(4):
        result = found(tables(seed, 40, shared=0.9, **options), fix=fixed)
        fact = result.facts["second_readings"]
        assert not fact.ok
        assert fact.figures["p"] < 1e-4
        assert fact.figures["series"] == ["A", "B"]
        # a correlation of 0.9 has a standard error of (1 - 0.81)/sqrt(33) = 0.033
        assert all(0.9 - 0.2 < r < 1.0 for r in fact.figures["correlations"].values())
        # sqrt(1 + r) where all rows are paired
        assert 1.2 < fact.figures["factor"] < 2.0**0.5 + 0.01
        assert fact.says.startswith("B looks like a second reading of the impacts of A: errors of ")
        assert "give the mean of the two readings, or keep one (--series A)" in fact.says
        words = " ".join(result.summary().split())
        assert words.startswith("LOOK a series looks like a second reading of another")


def test_what_it_feigns_stands_behind_it():
    """Errors in pairs are runs of one sign: a lack of fit of unknown noise may follow from them."""
    said = 0
    for seed in range(8):
        data = tables(seed, 40, shared=0.95, observables=("v_x", "v_n"))
        lack = found(data, fix={}).facts["lack_of_fit"]
        said += not lack.ok
        assert lack.ok or "may follow from impacts that were read twice" in lack.says
    assert said >= 1


def test_the_mean_of_both_is_no_second_reading_and_has_the_right_sd():
    data = tables(1, 40, shared=0.9)
    both, one = found(data), found({"A": data["A"]})
    mean = found({"mean": (data["A"] + data["B"]) / 2.0})
    assert "second_readings" not in mean.facts
    factor = both.facts["second_readings"].figures["factor"]
    # sd of one table's worth of impacts; noises of 40 rows each are known to a ninth
    for name in ("e_t", "mu"):
        ratio = mean.constants[name].stderr / both.constants[name].stderr
        assert ratio == pytest.approx(factor, rel=0.3)
        assert one.constants[name].stderr == pytest.approx(mean.constants[name].stderr, rel=0.35)


def test_p_values_of_independent_series_are_exact(monkeypatch):
    """Angles that both share, and a curve that the law misses there: p is uniform, or larger."""
    rng = np.random.default_rng(2)
    n = 24
    along = np.linspace(0.2, 5.0, n)
    jacobian = np.column_stack((along < 2.0, np.where(along < 2.0, 0.0, 1.0 / along)))
    smooth = 0.5 * np.sin(along)
    p = []
    for _ in range(4000):
        z = np.concatenate([smooth + rng.standard_normal(n) for _ in range(2)])
        pairs = room.Pairs("beta", np.arange(n), np.arange(n, 2 * n), along)
        alike = room.errors_alike(np.tile(np.arange(n), 2), np.tile(jacobian, (2, 1)), z, pairs)
        p.append(1.0 if alike is None else alike.p)
    for limit in (0.05, 0.005):
        assert stats.binomtest(int((np.array(p) < limit).sum()), len(p), limit, "greater").pvalue > 1e-3


@pytest.mark.parametrize(
    ("options", "fixed"),
    [
        ({"n": 12}, FIXED),
        ({"n": 40, "nominal": True}, FIXED),
        ({"n": 20, "nominal": True, "repeats": 2}, FIXED),
        ({"n": 40, "nominal": True, "repeats": 5, "observables": ("v_x", "v_n", "spin_y")}, {}),
        ({"n": 40, "nominal": True, "law": {"e_n": 0.85, "beta0": 0.6, "mu": 0.13}}, FIXED),
    ],
)
@pytest.mark.parametrize("seeds", rest_long((8, 200)))
def test_independent_series_at_the_same_angles_are_none(options, fixed, seeds):
    options = dict(options)
    n = options.pop("n")
    alarms = 0
    for seed in range(seeds):
        data = tables(seed, n, shared=0.0, **options)
        data = {name: each.rename(columns={"spin_y": "spin_y_after"}) for name, each in data.items()}
        alarms += "second_readings" in found(data, fix=fixed).facts
    assert alarms <= at_most(seeds, 0.001)


def test_values_that_were_sorted_at_each_angle_are_none():
    """Sorted repeats go together by their ranks; nothing tells which impact is which."""
    for seed in range(6):
        data = tables(seed, 40, shared=0.0, nominal=True, repeats=5)
        data = {name: each.sort_values(["gamma", "beta"], ignore_index=True) for name, each in data.items()}
        assert "second_readings" not in found(data).facts


def test_errors_in_common_that_were_stated_are_not_asked_again():
    data = tables(1, 30, shared=0.9)
    table = ifrfit.read(data).table
    assert list(table["series"]) == ["A"] * 30 + ["B"] * 30
    covariance = NOISE**2 * np.block([[np.eye(30), 0.9 * np.eye(30)], [0.9 * np.eye(30), np.eye(30)]])
    assert "second_readings" in found(data).facts
    assert "second_readings" not in found(data, covariance=covariance).facts
