"""Compiled loops against the reference path."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import pytest
from factories import own_constant

from ifrfit.errors import UsageError
from ifrfit.physics import compiling, get_closure
from ifrfit.physics.angles import Incidence, sincos
from ifrfit.physics.closures import CLOSURES as REGISTRY
from ifrfit.physics.compliance.solvers import _collision, _steps, memory_ratio
from ifrfit.physics.kernels import available, has_loop, rebound_many
from ifrfit.physics.rebound import rebound_of

needs_numba = pytest.mark.skipif(not available(), reason="numba is not installed")

CLOSURES = {name: own_constant(name) for name, closure in REGISTRY.items() if has_loop(closure)}


def scene(n: int, *, hard: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    sine, cosine = sincos(rng.uniform(0.0, 90.0, n), degrees=True)
    spin_x, spin_y = rng.normal(0.0, 0.4, n), rng.normal(0.0, 0.4, n)
    if hard:
        sine[:6], cosine[:6] = [0.0, 1.0, 0.5, 0.0, 1.0, 0.6], [1.0, 0.0, 0.75**0.5, 1.0, 0.0, 0.8]
        spin_x[:6], spin_y[:6] = [0.0, 0.0, 0.0, 1e140, 1e-180, 0.0], [0.0, -1.0, -0.5, 1e140, -1.0, 1e15]
    return sine, cosine, spin_x, spin_y


def call(closure: str) -> dict[str, Any]:
    return {"e_n": 0.9, "mu": 0.2, "closure": closure} | CLOSURES[closure]


def ulps(found: np.ndarray, expected: np.ndarray, largest: np.ndarray) -> float:
    return float(np.max(np.abs(found - expected) / np.spacing(largest)))


@needs_numba
@pytest.mark.parametrize("closure", CLOSURES)
@pytest.mark.parametrize("hard", [False, True])
def test_within_four_units_of_the_last_place(closure: str, hard: bool) -> None:
    sine, cosine, s_x, s_y = scene(20_000, hard=hard)
    expected = _reference(sine, cosine, s_x, s_y, closure)
    found = rebound_many(sine, cosine, s_y, s_x, **call(closure))
    largest = np.maximum(1.0, np.hypot(np.abs(s_x), np.abs(s_y) + sine))
    assert found.v_y is not None
    assert found.spin_x is not None
    for name, per_push in (("v_x", 1.0), ("v_y", 1.0), ("spin_x", 2.5), ("spin_y", 2.5)):
        assert ulps(getattr(found, name), getattr(expected, name), per_push * largest) <= 4.0, name
    assert (found.v_n == expected.v_n).all()


def _reference(sine: np.ndarray, cosine: np.ndarray, s_x: Any, s_y: Any, closure: str) -> Any:
    """The reference path, from the very same sines."""
    s_x = np.zeros_like(sine) if s_x is None else s_x
    incidence = Incidence(sine, cosine, s_x, s_y, sine + s_y, s_x)
    own = next(iter(CLOSURES[closure].values()), 0.0)
    return rebound_of(incidence, get_closure(closure), 0.9, own, 0.2, 0.4)


@needs_numba
@pytest.mark.parametrize("closure", CLOSURES)
def test_planar_loop_equals_the_spatial_one_to_the_last_bit(closure: str) -> None:
    sine, cosine, _, s_y = (x.copy() for x in scene(5_000))
    flat = rebound_many(sine, cosine, s_y, **call(closure))
    deep = rebound_many(sine, cosine, s_y, np.zeros_like(s_y), **call(closure))
    assert flat.v_y is None
    for name in ("v_x", "v_n", "spin_y"):
        assert (getattr(flat, name) == getattr(deep, name)).all()
    assert deep.v_y is not None
    assert not deep.v_y.any()
    if closure != "maw":
        expected = _reference(sine, cosine, None, s_y, closure)
        assert (flat.v_x == expected.v_x).all()
        assert (flat.spin_y == expected.spin_y).all()


@needs_numba
def test_single_precision_and_given_arrays() -> None:
    sine, cosine, s_x, s_y = (x.astype(np.float32) for x in scene(1_000))
    out = [np.empty_like(sine) for _ in range(5)]
    found = rebound_many(sine, cosine, s_y, s_x, **call("ifr"), out=out)
    assert found.v_x is out[0]
    assert found.spin_y is out[4]
    assert found.v_x.dtype == np.float32
    wide = rebound_many(*(x.astype(float) for x in (sine, cosine, s_y, s_x)), **call("ifr"))
    assert np.abs(found.v_x - wide.v_x).max() < 1e-6


@needs_numba
def test_refusals() -> None:
    sine, cosine, _, s_y = scene(10)
    with pytest.raises(UsageError, match="one length and one type"):
        rebound_many(sine, cosine[:5], s_y, **call("ifr"))
    with pytest.raises(UsageError, match="float64 or float32, not int64"):
        rebound_many(*(x.astype(int) for x in (sine, cosine, s_y)), **call("ifr"))
    with pytest.raises(UsageError, match="out needs 3 arrays, not 1"):
        rebound_many(sine, cosine, s_y, **call("ifr"), out=[sine])
    with pytest.raises(UsageError, match="Closure IFR needs e_t"):
        rebound_many(sine, cosine, s_y, e_n=0.9, mu=0.1)


def test_without_numba(monkeypatch: pytest.MonkeyPatch) -> None:
    """The loops say what is missing; the memory function runs as plain Python, with the same result."""
    # by its full name: the package has the function of that name
    module = importlib.import_module("ifrfit.physics.kernels.rebound_many")
    monkeypatch.setattr(module, "available", lambda: False)
    sine, cosine, _, s_y = scene(10)
    with pytest.raises(UsageError, match=r"need numba, which is not installed: pip install 'ifrfit\[fast\]'"):
        rebound_many(sine, cosine, s_y, **call("ifr"))
    monkeypatch.setattr(compiling, "available", lambda: False)
    assert compiling.compiled.__wrapped__(_collision) is _collision
    plain = _collision(1.7, 1.44, *_steps(500))
    assert plain == pytest.approx(float(memory_ratio(np.array([1.7]), np.array([1.44]), 1000)[0]), abs=1e-13)
