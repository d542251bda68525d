"""A digest of frozen values: equal for equal values, in every process."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from types import MappingProxyType

import numpy as np

EXCLUDED: Mapping[str, bool] = MappingProxyType({"excluded from digest": True})  # metadata of a field


def digest(value: object) -> str:
    """SHA-256 of a value, in hexadecimal digits.

    A dataclass counts with its class and all its fields, theirs included, but for those with the metadata
    `EXCLUDED`; an array with its type, shape and bytes; a function with the name under which it is defined,
    an object that can be called also with its attributes.

    Raises
    ------
    TypeError
        For a value of a kind that has no digest.
    """
    found = hashlib.sha256()
    for part in _parts(value):
        found.update(len(part).to_bytes(8, "little"))
        found.update(part)
    return found.hexdigest()


def _parts(value: object) -> Iterator[bytes]:
    """The value in pieces, each kind of value under its own name."""
    kind = type(value).__qualname__.encode()
    if value is None or isinstance(value, bool | int | str | bytes):
        yield kind
        yield value if isinstance(value, bytes) else str(value).encode()
    elif isinstance(value, float):
        yield b"float"
        yield value.hex().encode()
    elif isinstance(value, np.ndarray):
        yield f"array {value.dtype.kind}{value.dtype.itemsize} {value.shape}".encode()
        yield np.ascontiguousarray(value).astype(value.dtype.newbyteorder("<")).tobytes()
    elif is_dataclass(value) and not isinstance(value, type):
        yield b"dataclass " + kind
        for each in fields(value):
            if not each.metadata.keys() & EXCLUDED.keys():
                yield each.name.encode()
                yield from _parts(getattr(value, each.name))
    elif isinstance(value, Mapping):
        yield f"mapping {len(value)}".encode()
        for key in sorted(value):
            yield from _parts(key)
            yield from _parts(value[key])
    elif isinstance(value, tuple | list):
        yield f"sequence {len(value)}".encode()
        for each in value:
            yield from _parts(each)
    elif callable(value):
        yield from _function(value)
    else:
        raise TypeError(f"a {type(value).__qualname__} has no digest")


def _function(function: Callable[..., object]) -> Iterator[bytes]:
    if isinstance(function, functools.partial):
        yield b"partial"
        yield from _parts((function.func, function.args, function.keywords))
        return
    named = function if hasattr(function, "__qualname__") else type(function)
    yield b"function"
    yield f"{named.__module__}.{named.__qualname__}".encode()
    if named is not function:  # an object that can be called
        yield from _parts(vars(function))
