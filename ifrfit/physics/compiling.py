"""Numba where it is installed: imported when first used, and never needed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])


def available() -> bool:
    """Whether numba is installed."""
    return find_spec("numba") is not None


@cache
def compiled(function: Function) -> Function:
    """The function compiled, or as it is where numba is missing."""
    if not available():
        return function
    import numba

    made: Any = numba.njit(cache=True, error_model="numpy")(function)
    return cast(Function, made)
