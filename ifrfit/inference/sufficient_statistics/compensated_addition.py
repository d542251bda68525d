"""Additions to neighbouring sums that keep what rounding takes off, by the processor's vectors.

Each sum is an unevaluated pair of doubles (Knuth 1969, The Art of Computer Programming 2, 4.2.2). Of
additions written one after another numba makes as many instructions; said to be one of vectors, they are one.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.compiling import available

Array = NDArray[np.float64]


def add_to_sums(high: Array, low: Array, first: int | np.integer[Any], terms: tuple[float, ...]) -> None:
    """Add terms to as many neighbouring sums, from `first` on: what compiled loops call, see `use_vectors`.

    Parameters
    ----------
    high, low : ndarray, (n,)
        A sum is both together.
    first : int
    terms : tuple of float
    """
    for k, term in enumerate(terms, int(first)):
        total = high[k] + term
        part = total - high[k]
        low[k] += (high[k] - (total - part)) + (term - part)
        high[k] = total


@cache
def use_vectors() -> None:
    """Have loops that are compiled from here on take all terms of `add_to_sums` at once, to the same bits."""
    if not available():
        return
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic, overload

    @intrinsic
    def at_once(typing: Any, high: Any, low: Any, first: Any, terms: Any) -> Any:
        vector = ir.VectorType(ir.DoubleType(), len(terms))

        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            places = []
            for kind, array in zip(signature.args[:2], given[:2], strict=True):
                data = context.make_array(kind)(context, builder, array).data
                places.append(builder.bitcast(builder.gep(data, [given[2]]), vector.as_pointer()))
            term = ir.Constant(vector, ir.Undefined)
            for k in range(len(terms)):
                place = ir.Constant(ir.IntType(32), k)
                term = builder.insert_element(term, builder.extract_value(given[3], k), place)
            before, rest = (builder.load(place, align=8) for place in places)
            total = builder.fadd(before, term)
            part = builder.fsub(total, before)
            lost = builder.fadd(builder.fsub(before, builder.fsub(total, part)), builder.fsub(term, part))
            builder.store(total, places[0], align=8)
            builder.store(builder.fadd(rest, lost), places[1], align=8)
            return context.get_dummy_value()

        return types.void(high, low, first, terms), generate

    @overload(add_to_sums, strict=False)
    def compiled_add(high: Any, low: Any, first: Any, terms: Any) -> Any:
        return lambda high, low, first, terms: at_once(high, low, first, terms)  # type: ignore[call-arg]
