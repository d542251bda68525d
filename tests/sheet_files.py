"""Spreadsheets written by hand: what Excel and LibreOffice keep of cells, and no more."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Mapping, Sequence
from xml.sax.saxutils import escape

Rows = Sequence[Sequence[object]]


def _zipped(files: Mapping[str, str]) -> bytes:
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return held.getvalue()


def _xlsx_cell(at: str, cell: object) -> str:
    if isinstance(cell, int | float):
        return f'<c r="{at}"><v>{cell!r}</v></c>'
    return f'<c r="{at}" t="inlineStr"><is><t>{escape(str(cell))}</t></is></c>' if cell else ""


def xlsx(sheets: Mapping[str, Rows], merged: Sequence[str] = ()) -> bytes:
    ranges = "".join(f'<mergeCell ref="{each}"/>' for each in merged)
    ranges = f'<mergeCells count="{len(merged)}">{ranges}</mergeCells>' if merged else ""
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    packages = "http://schemas.openxmlformats.org/package/2006"
    tabs = "".join(
        f'<sheet name="{escape(name)}" sheetId="{i}" r:id="rId{i}"/>' for i, name in enumerate(sheets, 1)
    )
    links = "".join(
        f'<Relationship Id="rId{i}" Type="{office}/worksheet" Target="worksheets/sheet{i}.xml"/>'
        for i in range(1, len(sheets) + 1)
    )
    files = {
        "[Content_Types].xml": f'<Types xmlns="{packages}/content-types"><Default Extension="xml" '
        'ContentType="application/xml"/></Types>',
        "_rels/.rels": f'<Relationships xmlns="{packages}/relationships"><Relationship Id="r" '
        f'Type="{office}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{main}" xmlns:r="{office}"><sheets>{tabs}</sheets></workbook>',
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{packages}/relationships">'
        f"{links}</Relationships>",
    }
    for i, rows in enumerate(sheets.values(), 1):
        body = "".join(
            f'<row r="{r}">'
            + "".join(_xlsx_cell(f"{chr(65 + c)}{r}", cell) for c, cell in enumerate(row))
            + "</row>"
            for r, row in enumerate(rows, 1)
        )
        files[f"xl/worksheets/sheet{i}.xml"] = (
            f'<worksheet xmlns="{main}"><sheetData>{body}</sheetData>{ranges}</worksheet>'
        )
    return _zipped(files)


def _ods_cell(cell: object) -> str:
    if isinstance(cell, int | float):
        return f'<table:table-cell office:value-type="float" office:value="{cell!r}"/>'
    text = f"<text:p>{escape(str(cell))}</text:p>" if cell else ""
    kind = ' office:value-type="string"' if cell else ""
    return f"<table:table-cell{kind}>{text}</table:table-cell>"


def ods(sheets: Mapping[str, Rows]) -> bytes:
    base = "urn:oasis:names:tc:opendocument:xmlns"
    spaces = " ".join(f'xmlns:{each}="{base}:{each}:1.0"' for each in ("office", "table", "text"))
    tables = "".join(
        f'<table:table table:name="{escape(name)}">'
        + "".join(f"<table:table-row>{''.join(map(_ods_cell, row))}</table:table-row>" for row in rows)
        + "</table:table>"
        for name, rows in sheets.items()
    )
    return _zipped(
        {
            "mimetype": "application/vnd.oasis.opendocument.spreadsheet",
            "META-INF/manifest.xml": f'<manifest:manifest xmlns:manifest="{base}:manifest:1.0"/>',
            "content.xml": f"<office:document-content {spaces}><office:body><office:spreadsheet>{tables}"
            "</office:spreadsheet></office:body></office:document-content>",
        }
    )


def _record(kind: int, body: bytes = b"") -> bytes:
    """A record of .xlsb: number and length seven bits at a time, then its content."""
    head = bytes([kind]) if kind < 128 else bytes([kind & 0x7F | 0x80, kind >> 7])
    size, length = len(body), b""
    while True:
        length += bytes([size & 0x7F | (0x80 if size >= 128 else 0)])
        size >>= 7
        if not size:
            return head + length + body


def _wide(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode("utf-16-le")


def xlsb(sheets: Mapping[str, Rows]) -> bytes:
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    packages = "http://schemas.openxmlformats.org/package/2006"
    tabs = b"".join(
        _record(156, struct.pack("<II", 0, i) + _wide(f"rId{i}") + _wide(name))
        for i, name in enumerate(sheets, 1)
    )
    links = "".join(
        f'<Relationship Id="rId{i}" Type="{office}/worksheet" Target="worksheets/sheet{i}.bin"/>'
        for i in range(1, len(sheets) + 1)
    )
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", f'<Types xmlns="{packages}/content-types"/>')
        archive.writestr(
            "_rels/.rels",
            f'<Relationships xmlns="{packages}/relationships"><Relationship Id="r" '
            f'Type="{office}/officeDocument" Target="xl/workbook.bin"/></Relationships>',
        )
        archive.writestr(
            "xl/_rels/workbook.bin.rels",
            f'<Relationships xmlns="{packages}/relationships">{links}</Relationships>',
        )
        archive.writestr("xl/workbook.bin", _record(131) + _record(143) + tabs + _record(144) + _record(132))
        for i, rows in enumerate(sheets.values(), 1):
            width = max(map(len, rows), default=1)
            body = _record(129) + _record(148, struct.pack("<IIII", 0, max(len(rows) - 1, 0), 0, width - 1))
            body += _record(145)
            for r, row in enumerate(rows):
                body += _record(0, struct.pack("<IIHHBI", r, 0, 300, 0, 0, 0))
                for c, cell in enumerate(row):
                    if isinstance(cell, int | float):
                        body += _record(5, struct.pack("<IId", c, 0, float(cell)))
                    elif cell:
                        body += _record(6, struct.pack("<II", c, 0) + _wide(str(cell)))
            archive.writestr(f"xl/worksheets/sheet{i}.bin", body + _record(146) + _record(130))
    return held.getvalue()


def _biff(kind: int, body: bytes = b"") -> bytes:
    """A record of .xls."""
    return struct.pack("<HH", kind, len(body)) + body


def xls(sheets: Mapping[str, Rows]) -> bytes:
    begin = {of: _biff(0x809, struct.pack("<HHHHII", 0x600, of, 0, 1997, 0, 0x600)) for of in (5, 16)}
    parts = []
    for rows in sheets.values():
        width = max(map(len, rows), default=0)
        body = begin[16] + _biff(0x200, struct.pack("<IIHHH", 0, len(rows), 0, width, 0))
        for r, row in enumerate(rows):
            for c, cell in enumerate(row):
                at = struct.pack("<HHH", r, c, 0)
                if isinstance(cell, int | float):
                    body += _biff(0x203, at + struct.pack("<d", float(cell)))
                elif cell:
                    body += _biff(
                        0x204, at + struct.pack("<HB", len(str(cell)), 1) + str(cell).encode("utf-16-le")
                    )
        parts.append(body + _biff(0x0A))
    first = begin[5] + _biff(0x42, struct.pack("<H", 1200))
    names = [struct.pack("<BBBB", 0, 0, len(name), 1) + name.encode("utf-16-le") for name in sheets]
    place = len(first) + sum(len(name) + 8 for name in names) + 4
    for name, part in zip(names, parts, strict=True):
        first += _biff(0x85, struct.pack("<I", place) + name)
        place += len(part)
    return _compound("Workbook", first + _biff(0x0A) + b"".join(parts))


def _compound(name: str, stream: bytes) -> bytes:
    """A compound file of one stream, at least 4096 bytes long, so that it lies in whole sectors."""
    size = 512
    stream = stream.ljust(4096, b"\0")
    stream += bytes(-len(stream) % size)
    count, free, end = len(stream) // size, 0xFFFFFFFF, 0xFFFFFFFE
    header = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(16)
    header += struct.pack("<HHHHH6xIIIIIIIII", 0x3E, 3, 0xFFFE, 9, 6, 0, 1, 1, 0, 4096, end, 0, end, 0)
    header += struct.pack("<109I", 0, *[free] * 108)
    chain = [0xFFFFFFFD, end, *range(3, count + 2), end]
    table = struct.pack("<128I", *chain, *[free] * (128 - len(chain)))

    def entry(title: str, kind: int, child: int, start: int, length: int) -> bytes:
        text = title.encode("utf-16-le") + b"\0\0"
        links = struct.pack("<HBBIII", len(text), kind, 1, free, free, child)
        return text.ljust(64, b"\0") + links + bytes(36) + struct.pack("<IQ", start, length)

    folder = entry("Root Entry", 5, 1, end, 0) + entry(name, 2, free, 2, len(stream))
    return header + table + folder.ljust(size, b"\0") + stream
