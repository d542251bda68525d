"""Batches in which every row is good, as nearly all are: one loop a column sees it.

Whatever is odd in a batch (an impossible value, a code for "not measured", an angle at which an observable
has no value) leaves the whole of it to `ImpactStream.impacts_of`, which knows what is wrong and where. Both
give the same bits, because a batch may hold an odd row or not according to how the rows were parted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.column_layout import Column as LayoutColumn
from ifrfit.data.column_layout import Layout
from ifrfit.data.column_names import UNITS
from ifrfit.data.schema import SIGMA_RANGE, SPEED_RANGE, TINY
from ifrfit.physics.angles import Incidence
from ifrfit.physics.compiled_incidence import read_only
from ifrfit.physics.compiling import compiled
from ifrfit.physics.observables import FREE, OBSERVABLES

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]
Range = tuple[float, float]

_MOST = 98.0  # the codes for "not measured" that are no short ones begin above
_SHORT = (9.0, 10.0)  # between these lie the short ones
_SIZE = 0x7FFFFFFFFFFFFFFF  # the bits of a double but for its sign
_INFINITE = 0x7FF0000000000000  # those of infinity; beyond are those of what is no number
_TINY = int(np.float64(TINY).view(np.int64))
_NEAR = 1e-9  # degrees from 0 and 90: nearer an observable may have no value
_MOVES = 4e-12  # of the contact point, over 1 + |spin|: twice that and more of what counts as no motion


class Column(NamedTuple):
    """A column of numbers as it stands in a batch.

    Attributes
    ----------
    values : ndarray, (n,)
    has_gaps : bool
        Whether a value is missing, as nan.
    size : float
        Largest size; negative without a value.
    ends : (float, float)
        Least and largest value; nothing to go by without one.
    """

    values: Array
    has_gaps: bool
    size: float
    ends: Range


@dataclass(frozen=True)
class PlainRows:
    """Which columns of a file are read as they stand, and between what their values lie.

    Attributes
    ----------
    columns : mapping of str to (int, float, float)
        Place, least and largest value, by key.
    observables : tuple of (str, str or None)
        Keys of value and sigma.
    may_rest : bool
        Whether an observable has no value where the contact point rests.
    """

    columns: Mapping[str, tuple[int, float, float]]
    observables: tuple[tuple[str, str | None], ...]
    may_rest: bool

    @classmethod
    def of(
        cls, layout: Layout, observables: tuple[str, ...], has_sigma: bool, ranges: Mapping[str, Any]
    ) -> PlainRows | None:
        """What is to be seen of each batch of a file; None if its columns need more than to be read."""
        if layout.has("tan_gamma") or layout.angle_from != "from-normal":
            return None
        kinds = {kind for name in observables for kind in OBSERVABLES[name].undefined}
        near, grazing = _NEAR if kinds & {"contact", "normal"} else 0.0, "grazing" in kinds
        wanted: dict[str, Range] = {"gamma": (near, 90.0 - _NEAR if grazing else 90.0)}
        wanted |= {name: (-FREE, FREE) for name in ("spin_x", "spin_y") if layout.has(name)}
        if layout.has("speed"):
            wanted["speed"] = SPEED_RANGE
        pairs: list[tuple[str, str | None]] = []
        for name in observables:
            sigma = layout.sigma_key(name)
            pairs.append((name, sigma))
            wanted[name] = (OBSERVABLES[name].low, OBSERVABLES[name].high)
            if sigma is not None:
                wanted[sigma] = SIGMA_RANGE if has_sigma else (-_MOST, _MOST)
        found = {}
        for key, (low, high) in wanted.items():
            if not layout.has(key) or not _stands_as_it_is(layout.columns[key]):
                return None
            least, most = ranges.get(key, (None, None))
            low, high = max(low, -_MOST), min(high, 90.0 if key == "gamma" else _MOST)
            found[key] = (
                layout.columns[key].index,
                low if least is None else max(low, least),
                high if most is None else min(high, most),
            )
        if set(ranges) - set(found):
            return None
        return cls(found, tuple(pairs), "contact" in kinds)

    def read(self, batch: pa.RecordBatch) -> dict[str, Column] | None:
        """The columns, if every row is good."""
        import pyarrow as pa

        found = {}
        for key, (index, low, high) in self.columns.items():
            column = batch.column(index)
            if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
                return None
            values = column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
            values = read_only(values)
            missing, tiny, least, most = ends_of(values)
            size = max(abs(least), abs(most)) if missing < values.size else -1.0
            # larger values than short codes beside these show that they are values, too
            is_odd = size >= 0.0 and (least < low or most > high or _SHORT[0] <= size <= _SHORT[1])
            if tiny or is_odd or (missing and key not in OBSERVABLES):
                return None
            found[key] = Column(values, bool(missing), size, (least, most))
        return found

    def moves(self, incidence: Incidence) -> bool:
        """Whether every contact point moves, where that matters."""
        i = incidence
        return not self.may_rest or compiled(_all_move)(
            *map(read_only, (i.slip_x, i.slip_y, i.spin_x, i.spin_y))
        )


@lru_cache(maxsize=4)
def all_rows(n: int) -> NDArray[np.intp]:
    """0, 1 ... n - 1."""
    found = np.arange(n)
    found.flags.writeable = False
    return found


@lru_cache(maxsize=8)
def same_in_all(value: float, n: int, *, whole: bool = False) -> NDArray[Any]:
    """A number n times; `whole`: an integer."""
    found = np.full(n, value, dtype=np.intp if whole else np.float64)
    found.flags.writeable = False
    return found


def in_one_piece(values: Array) -> Array:
    """An array as loops take it; of one number, which stands for all, it is made once."""
    return same_in_all(float(values[0]), values.size) if values.size and not values.strides[0] else values


def _stands_as_it_is(column: LayoutColumn) -> bool:
    """Whether a column is in the unit and sign of the schema."""
    if column.unit is None:
        return column.sign == 1.0 and column.dimension == "number"
    return column.sign == 1.0 and UNITS[column.unit][1] == 1.0


def ends_of(values: Array) -> tuple[int, int, float, float]:
    """How many numbers are missing, how many tinier than `TINY`, and the least and the largest number."""
    missing, tiny, *places = compiled(_ends)(values.view(np.int64))
    ends = _ordered(np.array(places, dtype=np.int64)).view(np.float64)
    return missing, tiny, float(ends[0]), float(ends[1])


def _ordered(bits: Any) -> Any:
    """The bits of doubles as integers of the same order, and back: those of negative ones turn round."""
    return bits ^ ((bits >> 63) & _SIZE)


def _ends(bits: NDArray[np.int64]) -> tuple[int, int, int, int]:
    # what is found is turned into numbers elsewhere: here numba would take the rows one by one for it
    missing, tiny = 0, 0
    least, most = _SIZE, -_SIZE - 1
    for i in range(bits.size):
        of = bits[i] & _SIZE
        is_missing = of > _INFINITE
        missing += is_missing
        tiny += (of != 0) & (of < _TINY)
        ordered = bits[i] ^ ((bits[i] >> 63) & _SIZE)
        least = min(least, _SIZE if is_missing else ordered)
        most = max(most, -_SIZE - 1 if is_missing else ordered)
    return missing, tiny, least, most


def _all_move(slip_x: Array, slip_y: Array, spin_x: Array, spin_y: Array) -> bool:
    """Whether every contact point moves; without any spin at angles beyond `_NEAR` it does."""
    resting, spinning = 0, 0
    for i in range(slip_x.size):
        spin = abs(spin_x[i]) + abs(spin_y[i])
        resting += not (abs(slip_x[i]) + abs(slip_y[i]) > _MOVES * (1.0 + spin))
        spinning += spin > 0.0
    return resting == 0 or spinning == 0
