"""The sheets of .xls as far as their extent: streams of a compound file, and the records in them."""

from __future__ import annotations

import struct

_HEAD = 512
_STREAMS = ("Workbook", "Book")
_SMALL = 4096  # bytes below which a stream lies in small sectors
_SMALL_SECTOR = 64
_ENTRY = 128
# numbers of the records of BIFF that hold one cell, or several in a row
_ONE_CELL = frozenset(
    {0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x201, 0x203, 0x204, 0x205, 0x206, 0x406, 0x7E, 0x27E, 0xD6, 0xFD}
)
_CELLS = frozenset({0xBD, 0xBE})


def extent_of_xls(raw: bytes) -> tuple[int, int] | None:
    """Rows and columns that the cells of all sheets reach over; None where the file is damaged.

    Parameters
    ----------
    raw : bytes
    """
    try:
        records = _workbook(raw)
    except (struct.error, IndexError, KeyError, StopIteration, ValueError):
        return None
    right = down = at = 0
    while at + 4 <= len(records):
        kind, size = struct.unpack_from("<HH", records, at)
        at += 4
        if kind in _ONE_CELL and size >= 4:
            row, column = struct.unpack_from("<HH", records, at) if at + 4 <= len(records) else (0, 0)
            down, right = max(down, row + 1), max(right, column + 1)
        elif kind in _CELLS and 6 <= size <= len(records) - at:
            row = struct.unpack_from("<H", records, at)[0]
            last = struct.unpack_from("<H", records, at + size - 2)[0]
            down, right = max(down, row + 1), max(right, last + 1)
        at += size
    return down, right


def _workbook(raw: bytes) -> bytes:
    """The stream that holds the sheets."""
    size = 1 << struct.unpack_from("<H", raw, 30)[0]
    if size not in (512, 4096):
        raise ValueError
    first_folder, first_small = (struct.unpack_from("<I", raw, place)[0] for place in (48, 60))
    next_table, tables = struct.unpack_from("<I", raw, 68)[0], list(struct.unpack_from("<109I", raw, 76))
    while next_table < len(raw) // size:
        more = struct.unpack_from(f"<{size // 4}I", raw, (next_table + 1) * size)
        tables, next_table = [*tables, *more[:-1]], more[-1]
        if len(tables) > len(raw) // 4:
            raise ValueError
    filled = [each for each in tables if each < len(raw) // size]
    table = [x for each in filled for x in struct.unpack_from(f"<{size // 4}I", raw, (each + 1) * size)]
    sectors = raw[size:] if size > _HEAD else raw[_HEAD:]
    folder = _chained(sectors, table, first_folder, size)
    entries = {}
    for at in range(0, len(folder) - _ENTRY + 1, _ENTRY):
        length = struct.unpack_from("<H", folder, at + 64)[0]
        name = folder[at : at + max(min(length, 64) - 2, 0)].decode("utf-16-le", "replace")
        entries[name] = struct.unpack_from("<IQ", folder, at + 116)
    start, count = next(entries[name] for name in _STREAMS if name in entries)
    if count >= _SMALL:
        return _chained(sectors, table, start, size)[:count]
    small = _chained(sectors, table, first_small, size)
    chain = list(struct.unpack_from(f"<{len(small) // 4}I", small))
    return _chained(_chained(sectors, table, entries["Root Entry"][0], size), chain, start, _SMALL_SECTOR)[
        :count
    ]


def _chained(sectors: bytes, table: list[int], start: int, size: int) -> bytes:
    """The sectors of a chain, in order."""
    found: list[bytes] = []
    place = start
    while place < len(table) and len(found) <= len(table):
        found.append(sectors[place * size : (place + 1) * size])
        place = table[place]
    if len(found) > len(table):
        raise ValueError
    return b"".join(found)
