"""The writer of charts: an svg element that needs no style sheet and nothing from elsewhere."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import Literal

import numpy as np

from ifrfit.report.page.charts.chart import (
    LABEL_LETTERS,
    TICK_LETTERS,
    Array,
    Axis,
    Band,
    Bars,
    Box,
    Chart,
    Entry,
    Legend,
    Line,
    Panel,
    Points,
    Words,
)
from ifrfit.report.page.charts.scales import Ticks
from ifrfit.report.page.charts.typesetting import content, width
from ifrfit.report.style import Dashes

POINTS_PER_MM = 72.0 / 25.4
TICK, GAP = 3.5, 3.5  # points: a tick mark, and between it and what is written
FRAME = 0.7
WIDE_GAP, NARROW_GAP = 0.4, 0.1  # between labels of ticks, over the size of their letters
TITLE_LETTERS = 7.5
FAR = 100.0  # lengths of the axis: what lies farther out is drawn there
# Verdana has nearly the widths of DejaVu Sans, which not every reader has
FAMILY = "DejaVu Sans, Verdana, sans-serif"
_DASHES = {"--": (3.7, 1.6), "-.": (6.4, 1.6, 1.0, 1.6), ":": (1.0, 1.65)}
# how far the baseline lies below the place of a text, by shares of the size
_BASELINE = {"top": 0.76, "middle": 0.36, "bottom": -0.1}
_LINE = 1.2  # of text, over its size
# points of a legend: a handle, before its label, between entries
_HANDLE, _BESIDE, _BETWEEN = 16.0, 4.0, 10.0
# within -1 ... 1, named as matplotlib names them; y points down
SHAPES = {
    "o": "M-1 0a1 1 0 1 0 2 0a1 1 0 1 0-2 0z",
    "s": "M-1-1H1V1H-1z",
    "^": "M0-1L1 1H-1z",
    "v": "M0 1L-1-1H1z",
    "<": "M-1 0L1-1V1z",
    ">": "M1 0L-1 1V-1z",
    "D": "M0-1.41L1.41 0 0 1.41-1.41 0z",
    "P": "M-.34-1H.34V-.34H1V.34H.34V1H-.34V.34H-1V-.34H-.34z",
    "X": "M-.5-1L0-.5.5-1 1-.5.5 0 1 .5.5 1 0 .5-.5 1-1 .5-.5 0-1-.5z",
    "h": "M0-1L.87-.5V.5L0 1-.87.5V-.5z",
    "x": "M-1-1L1 1M-1 1L1-1",
}


def svg(chart: Chart, name: str, *, attributes: Mapping[str, str] | None = None, head: str = "") -> str:
    """A chart as an ``svg`` element, in points.

    Parameters
    ----------
    chart : Chart
    name : str
        Prefix of its ids, which are unique on a page if names are.
    attributes : mapping of str to str, optional
        Of the element, beyond its view box.
    head : str
        What stands in it before everything else: title and description.
    """
    return _Writer(chart, name).written(attributes or {}, head)


def hexadecimal(colour: str) -> str:
    """A colour as svg knows it: a level of grey from "0" to "1" becomes one."""
    if colour == "none" or colour.startswith("#"):
        return colour
    level = f"{round(255.0 * float(colour)):02x}"
    return f"#{3 * level}"


def number(x: float) -> str:
    """A coordinate to 0.01 point, without zeros that mean nothing."""
    text = f"{x:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def joined(x: Array, y: Array) -> str:
    """A line through places on the chart as a path, broken where one is not finite."""
    known = np.isfinite(x) & np.isfinite(y)
    pieces, pen_is_down = [], False
    for across, down, is_known in zip(x.tolist(), y.tolist(), known.tolist(), strict=True):
        if is_known:
            pieces.append(f"{'L' if pen_is_down else 'M'}{number(across)} {number(down)}")
        pen_is_down = is_known
    return "".join(pieces)


class _Frame:
    """A panel on the chart: from the units of its data to points."""

    def __init__(self, panel: Panel) -> None:
        self.left, self.top = panel.left * POINTS_PER_MM, panel.top * POINTS_PER_MM
        self.width, self.height = panel.width * POINTS_PER_MM, panel.height * POINTS_PER_MM
        self.right, self.bottom = self.left + self.width, self.top + self.height
        self._x, self._y = panel.x, panel.y

    def x(self, values: Array | Sequence[float] | float) -> Array:
        """Points from the left of the chart; the panel's end where a value is infinite."""
        return self.left + self.width * _share(self._x, values)

    def y(self, values: Array | Sequence[float] | float) -> Array:
        """Points from the top of the chart."""
        return self.bottom - self.height * _share(self._y, values)

    def box(self, box: Box) -> tuple[float, float, float, float]:
        """Left, right, top, bottom; infinite ends are the frame's."""
        x = [
            self.left if end == -math.inf else self.right if end == math.inf else float(self.x(end))
            for end in box.x
        ]
        y = [
            self.bottom if end == -math.inf else self.top if end == math.inf else float(self.y(end))
            for end in box.y
        ]
        return min(x), max(x), min(y), max(y)


def _share(axis: Axis, values: Array | Sequence[float] | float) -> Array:
    """Where values lie along an axis, 0 at its low end and 1 at its high end."""
    low, high = axis.scale.position(np.array([axis.low, axis.high], dtype=float))
    place = (axis.scale.position(np.asarray(values, dtype=float)) - low) / (high - low)
    return np.asarray(np.clip(place, -FAR, FAR))


class _Writer:
    """Writes one chart; knows the definitions that its marks refer to."""

    def __init__(self, chart: Chart, name: str) -> None:
        self.chart, self.name = chart, name
        self.defined: dict[str, str] = {}  # definition to id

    def written(self, attributes: Mapping[str, str], head: str) -> str:
        chart = self.chart
        body = "".join(self.panel(panel) for panel in chart.panels)
        body += "" if chart.legend is None else self.legend(chart.legend)
        definitions = "".join(text.replace("ID", name, 1) for text, name in self.defined.items())
        others = "".join(f' {key}="{escape(value)}"' for key, value in attributes.items())
        extent = f"{number(chart.width * POINTS_PER_MM)} {number(chart.height * POINTS_PER_MM)}"
        return (
            f'<svg viewBox="0 0 {extent}"{others} font-family="{FAMILY}" stroke-linejoin="round">{head}'
            f'<defs>{definitions}</defs><rect width="100%" height="100%" fill="#fff"/>{body}</svg>'
        )

    def define(self, text: str) -> str:
        """The id of a definition, which is written with ID in the place of its id."""
        return self.defined.setdefault(text, f"{self.name}-{len(self.defined) + 1}")

    # panels

    def panel(self, panel: Panel) -> str:
        frame = _Frame(panel)
        clip = self.define(
            f'<clipPath id="ID"><rect x="{number(frame.left)}" y="{number(frame.top)}" '
            f'width="{number(frame.width)}" height="{number(frame.height)}"/></clipPath>'
        )
        # neighbours that are clipped share a group; the frame lies above all of them
        written: list[str] = []
        on_frame: list[str] = []
        inside: list[str] = []
        for mark in panel.marks:
            text = self.mark(mark, frame)
            if isinstance(mark, Words):
                written += [_group(inside, clip), text]
                inside = []
            elif isinstance(mark, Points) and not mark.is_clipped:
                on_frame.append(text)
            else:
                inside.append(text)
        written.append(_group(inside, clip))
        return "<g>" + "".join(written) + self.axes(panel, frame) + "".join(on_frame) + "</g>"

    def axes(self, panel: Panel, frame: _Frame) -> str:
        """Frame, ticks, labels and title."""
        marks, words = [], []
        across, upwards = (
            chosen_ticks(axis, length, is_upright=is_upright)
            for axis, length, is_upright in ((panel.x, frame.width, False), (panel.y, frame.height, True))
        )
        for place in frame.x(across.places).tolist() if panel.x.marked else ():
            sides = _sides(panel.x, (frame.bottom, -TICK), (frame.top, TICK))
            marks += [f"M{number(place)} {number(start)}v{number(step)}" for start, step in sides]
        for place in frame.y(upwards.places).tolist() if panel.y.marked else ():
            sides = _sides(panel.y, (frame.left, TICK), (frame.right, -TICK))
            marks += [f"M{number(start)} {number(place)}h{number(step)}" for start, step in sides]
        if panel.has_frame:
            words.append(
                f'<rect x="{number(frame.left)}" y="{number(frame.top)}" width="{number(frame.width)}" '
                f'height="{number(frame.height)}" fill="none" stroke="#000" stroke-width="{FRAME}"/>'
            )
        if marks:
            words.append(f'<path d="{"".join(marks)}" stroke="#000" stroke-width=".8"/>')
        words += self.across(panel.x, across, frame) + self.upwards(panel.y, upwards, frame)
        if panel.title:
            middle = 0.5 * (frame.left + frame.right)
            words.append(_text(Words(middle, frame.top - GAP, panel.title, TITLE_LETTERS, height="bottom")))
        return "".join(words)

    def across(self, axis: Axis, ticks: Ticks, frame: _Frame) -> list[str]:
        """Labels under a panel, and under them what the axis shows."""
        place = frame.bottom + GAP
        written = []
        if axis.labelled:
            low, high = (frame.left, frame.right) if axis.inside else (0.0, self.chart.width * POINTS_PER_MM)
            found = [
                _text(Words(x, place, label, TICK_LETTERS, height="top"))
                for x, label in zip(
                    _kept_within(frame.x(ticks.places), ticks.labels, low, high).tolist(),
                    ticks.labels,
                    strict=True,
                )
            ]
            written.append(f"<g>{''.join(found)}</g>")
            place += 1.3 * TICK_LETTERS
        middle = 0.5 * (frame.left + frame.right)
        if ticks.note and axis.labelled:
            written.append(
                _text(Words(frame.right, place, ticks.note, 0.9 * TICK_LETTERS, anchor="end", height="top"))
            )
            taken = width(ticks.note, 0.9 * TICK_LETTERS) + GAP + 0.5 * width(axis.label, LABEL_LETTERS)
            middle = min(middle, frame.right - taken)
        if axis.label:
            written.append(_text(Words(middle, place + 0.8, axis.label, LABEL_LETTERS, height="top")))
        return written

    def upwards(self, axis: Axis, ticks: Ticks, frame: _Frame) -> list[str]:
        """Labels beside a panel, and what the axis shows."""
        side = frame.right + GAP if axis.is_far else frame.left - GAP
        written, longest = [], 0.0
        if axis.labelled:
            anchor: Literal["start", "end"] = "start" if axis.is_far else "end"
            found = [
                _text(Words(side, y, label, TICK_LETTERS, anchor=anchor))
                for y, label in zip(frame.y(ticks.places).tolist(), ticks.labels, strict=True)
            ]
            written.append(f"<g>{''.join(found)}</g>")
            longest = max((width(label, TICK_LETTERS) for label in ticks.labels), default=0.0)
            if ticks.note:
                top = frame.top - 2.0
                written.append(
                    _text(
                        Words(
                            frame.left, top, ticks.note, 0.9 * TICK_LETTERS, anchor="start", height="bottom"
                        )
                    )
                )
        if axis.label and axis.label_turned:
            lines = axis.label.split("\n")
            place = side - longest - 0.5 * LABEL_LETTERS - 3.5 - (len(lines) - 1) * _LINE * LABEL_LETTERS
            place = max(place, 0.6 * LABEL_LETTERS)  # rather near its ticks than cut
            middle = 0.5 * (frame.top + frame.bottom)
            for line in lines:
                written.append(_text(Words(place, middle, line, LABEL_LETTERS, turn=90.0)))
                place += _LINE * LABEL_LETTERS
        elif axis.label:
            middle, size = 0.5 * (frame.top + frame.bottom), 6.0
            written.append(_text(Words(side - longest - 3.0, middle, axis.label, size, anchor="end")))
        return written

    # marks

    def mark(self, mark: object, frame: _Frame) -> str:
        if isinstance(mark, Line):
            return _line(mark, frame.x(mark.x), frame.y(mark.y))
        if isinstance(mark, Band):
            return _band(mark, frame)
        if isinstance(mark, Box):
            return self.box(mark, frame)
        if isinstance(mark, Bars):
            return _bars(mark, frame)
        if isinstance(mark, Points):
            return self.points(mark, frame.x(mark.x), frame.y(mark.y))
        assert isinstance(mark, Words)
        return _text(replace(mark, x=float(frame.x(mark.x)), y=float(frame.y(mark.y))))

    def box(self, box: Box, frame: _Frame) -> str:
        left, right, top, bottom = frame.box(box)
        place = (
            f'<rect x="{number(left)}" y="{number(top)}" width="{number(right - left)}" '
            f'height="{number(bottom - top)}"'
        )
        outline = f' stroke="{hexadecimal(box.edge)}" stroke-width=".6"' if box.edge else ""
        written = f'{place} fill="{hexadecimal(box.colour)}"{outline}{_opacity(box.opacity)}/>'
        if box.is_hatched:
            lines = self.define(
                '<pattern id="ID" width="4" height="4" patternUnits="userSpaceOnUse">'
                '<path d="M-1 1L1-1M0 4L4 0M3 5L5 3" stroke="#000" stroke-width=".6"/></pattern>'
            )
            written += f'{place} fill="url(#{lines})"{_opacity(box.opacity)}/>'
        return written

    def points(self, points: Points, x: Array, y: Array) -> str:
        """Marks as markers of a path: a dozen characters a point, whatever they look like."""
        known = np.isfinite(x) & np.isfinite(y)
        if not known.any():
            return ""
        edge = points.edge_width if points.edge != "none" else 0.0
        extent = 0.5 * points.size + edge
        shape = self.define(
            f'<marker id="ID" markerUnits="userSpaceOnUse" overflow="visible" '
            f'markerWidth="{number(2.0 * extent)}" markerHeight="{number(2.0 * extent)}">'
            f'<path d="{SHAPES[points.marker]}" transform="scale({number(0.5 * points.size)})" '
            f'fill="{hexadecimal(points.fill)}"'
            + (
                f' stroke="{hexadecimal(points.edge)}" stroke-width="{edge / (0.5 * points.size):.3f}"'
                if edge
                else ""
            )
            + f"{_opacity(points.opacity)}/></marker>"
        )
        places = " ".join(
            f"{across:.1f},{down:.1f}"
            for across, down in zip(x[known].tolist(), y[known].tolist(), strict=True)
        )
        # the end of a path has no marker here: it is the last place once more
        return f'<path d="M{places}h0" fill="none" marker-start="url(#{shape})" marker-mid="url(#{shape})"/>'

    # the legend

    def legend(self, legend: Legend) -> str:
        written = []
        for row, entries in enumerate(legend.rows):
            y = (legend.top + (row + 0.5) * legend.ROW) * POINTS_PER_MM
            wide = sum(_HANDLE + _BESIDE + width(entry.label, legend.LETTERS) for entry in entries)
            x = 0.5 * (self.chart.width * POINTS_PER_MM - wide - _BETWEEN * (len(entries) - 1))
            for entry in entries:
                written.append(self.handle(entry, x, y))
                x += _HANDLE + _BESIDE
                written.append(_text(Words(x, y, entry.label, legend.LETTERS, anchor="start")))
                x += width(entry.label, legend.LETTERS) + _BETWEEN
        return f"<g>{''.join(written)}</g>"

    def handle(self, entry: Entry, x: float, y: float) -> str:
        written = ""
        if entry.line is not None:
            plain = replace(entry.line, halo=0.0)
            written += _line(plain, np.array([x, x + _HANDLE]), np.array([y, y]))
        if entry.point is not None:
            written += self.points(entry.point, np.array([x + 0.5 * _HANDLE]), np.array([y]))
        return written


def _group(written: Sequence[str], clip: str) -> str:
    return f'<g clip-path="url(#{clip})">{"".join(written)}</g>' if written else ""


def chosen_ticks(axis: Axis, length: float, *, is_upright: bool) -> Ticks:
    """Ticks of an axis `length` points long: up to `most`, fewer where labels would come too close.

    Labels come nearer to one another before a single one is left.
    """
    if axis.ticks is not None:
        return axis.ticks
    low, high = sorted((axis.low, axis.high))
    for between in (WIDE_GAP, NARROW_GAP):
        for most in range(axis.most, 1, -1):
            ticks = axis.scale.ticks(low, high, most, whole=axis.whole)
            if len(ticks.places) > 1 and _are_spaced(axis, ticks, length, between, is_upright):
                return ticks
    return ticks


def _are_spaced(axis: Axis, ticks: Ticks, length: float, between: float, is_upright: bool) -> bool:
    """Whether labels keep a distance from one another, by shares of the size of their letters."""
    places = length * _share(axis, ticks.places)
    if is_upright:
        return bool((np.abs(np.diff(places)) >= (1.0 + between) * TICK_LETTERS).all())
    if axis.inside:
        places = _kept_within(places, ticks.labels, 0.0, length)
    widths = np.array([width(label, TICK_LETTERS) for label in ticks.labels])
    room = np.abs(np.diff(places)) - 0.5 * (widths[1:] + widths[:-1])
    return bool((room >= between * TICK_LETTERS).all())


def _sides(axis: Axis, near: tuple[float, float], far: tuple[float, float]) -> list[tuple[float, float]]:
    """Where the tick marks of an axis start, and how far they go."""
    if axis.mirrored:
        return [near, far]
    return [far] if axis.is_far else [near]


def _kept_within(places: Array, labels: Sequence[str], low: float, high: float) -> Array:
    """Middles of labels, moved where one would stand out beyond an end."""
    halves = np.array([0.5 * width(label, TICK_LETTERS) for label in labels])
    return np.asarray(np.clip(places, low + halves, high - halves)) if len(labels) else places


def _line(line: Line, x: Array, y: Array) -> str:
    path = joined(x, y)
    if not path:
        return ""
    halo = (
        f'<path d="{path}" fill="none" stroke="#fff" stroke-width="{number(line.halo)}"/>'
        if line.halo
        else ""
    )
    return (
        f'{halo}<path d="{path}" fill="none" stroke="{hexadecimal(line.colour)}" '
        f'stroke-width="{number(line.width)}"{_dashes(line.dashes, line.width)}{_opacity(line.opacity)}/>'
    )


def _band(band: Band, frame: _Frame) -> str:
    known = np.isfinite(band.low) & np.isfinite(band.high)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], known, [False])).astype(int)))
    path = ""
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        x, low, high = frame.x(band.x[start:end]), frame.y(band.low[start:end]), frame.y(band.high[start:end])
        path += joined(np.concatenate((x, x[::-1])), np.concatenate((high, low[::-1]))) + "z"
    return f'<path d="{path}" fill="{hexadecimal(band.colour)}"{_opacity(band.opacity)}/>' if path else ""


def _bars(bars: Bars, frame: _Frame) -> str:
    place, value = (frame.x, frame.y) if bars.along == "y" else (frame.y, frame.x)
    at, low, high = place(bars.at), value(bars.low), value(bars.high)
    pieces = []
    for here, start, end in zip(at.tolist(), low.tolist(), high.tolist(), strict=True):
        if not (math.isfinite(here) and math.isfinite(start) and math.isfinite(end)) or start == end:
            continue
        half = 0.5 * bars.cap
        if bars.along == "y":
            pieces.append(f"M{number(here)} {number(start)}V{number(end)}")
            pieces += [
                f"M{number(here - half)} {number(y)}h{number(2.0 * half)}" for y in (start, end) if half
            ]
        else:
            pieces.append(f"M{number(start)} {number(here)}H{number(end)}")
            pieces += [
                f"M{number(x)} {number(here - half)}v{number(2.0 * half)}" for x in (start, end) if half
            ]
    if not pieces:
        return ""
    return (
        f'<path d="{"".join(pieces)}" fill="none" stroke="{hexadecimal(bars.colour)}" '
        f'stroke-width="{number(bars.width)}"{_opacity(bars.opacity)}/>'
    )


def _opacity(opacity: float) -> str:
    return "" if opacity >= 1.0 else f' opacity="{opacity:.3g}"'


def _dashes(dashes: Dashes, line_width: float) -> str:
    """Dashes are as long as the line is wide, times their numbers."""
    numbers = _DASHES.get(dashes, ()) if isinstance(dashes, str) else dashes[1]
    scaled = " ".join(number(each * line_width) for each in numbers)
    return f' stroke-dasharray="{scaled}"' if scaled else ""


def _text(words: Words) -> str:
    """A text in one or more lines at a place on the chart: the whole of them stands at y as `height` says."""
    size, turn = words.size, words.turn
    lines = words.text.split("\n")
    rise = {"top": 0.0, "middle": 0.5, "bottom": 1.0}[words.height] * (len(lines) - 1) * _LINE * size
    look = "" if words.colour == "0" else f' fill="{hexadecimal(words.colour)}"'
    look += "" if words.anchor == "start" else f' text-anchor="{words.anchor}"'
    look += ' font-weight="bold"' if words.is_bold else ""
    look += _opacity(words.opacity)
    written = []
    for i, line in enumerate(lines):
        x, y, shift = words.x, words.y, _BASELINE[words.height] * size - rise + i * _LINE * size
        place = (
            f'transform="translate({number(x)} {number(y)})rotate({number(-turn)})" y="{number(shift)}"'
            if turn
            else f'x="{number(x)}" y="{number(y + shift)}"'
        )
        written.append(f'<text {place} font-size="{number(size)}"{look}>{content(line, size)}</text>')
    return "".join(written)
