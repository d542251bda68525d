"""A picture as svg that stands in a page beside others: own ids, no style sheet, nothing from elsewhere."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from html import escape

from ifrfit.report.page.blocks import Picture
from ifrfit.report.page.charts.chart import Chart
from ifrfit.report.page.charts.svg import FAMILY, svg
from ifrfit.report.style import MM_PER_INCH, svg_text

_REFERENCE = re.compile(r"url\(#([^)]+)\)")
_FONT = re.compile(r"(?P<before>.*?)(?P<size>[\d.]+)px\s+(?P<family>.*)")
_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_XLINK = "{http://www.w3.org/1999/xlink}href"
_NAMESPACE = "http://www.w3.org/2000/svg"
DROPPED = ("metadata", "style")
PIXELS = 106.0  # an inch: a little larger than in print
# pixels from which a picture is scrolled rather than shrunk in a narrow window, and has a wide one for itself
WIDE, WIDEST = 560.0, 900.0
SMALL, LARGER = 400.0, 1.45  # how wide a small figure is at most, and how much larger it is shown


def inline(picture: Picture, *, alone: bool = False) -> str:
    """A picture as an ``svg`` element; a small one that stands `alone` is shown larger."""
    figure = picture.figure
    if isinstance(figure, Chart):
        return _chart(picture, figure, alone)
    return _rewritten(picture, figure if isinstance(figure, str) else svg_text(figure), alone)


def file_text(picture: Picture) -> str:
    """A picture as the text of an svg file."""
    if not isinstance(picture.figure, Chart):
        return picture.figure if isinstance(picture.figure, str) else svg_text(picture.figure)
    element = _chart(picture, picture.figure, False)
    return element.replace("<svg ", f'<svg xmlns="{_NAMESPACE}" ', 1)


def _chart(picture: Picture, chart: Chart, alone: bool) -> str:
    attributes = {**_named(picture), **_size(chart.width / MM_PER_INCH, chart.height / MM_PER_INCH, alone)}
    head = "".join(
        f'<{tag} id="{picture.name}-{part}">{escape(text, quote=False)}</{tag}>'
        for tag, part, text in (
            ("title", "title", picture.title),
            ("desc", "description", picture.description),
        )
    )
    return svg(chart, picture.name, attributes=attributes, head=head)


def _rewritten(picture: Picture, text: str, alone: bool) -> str:
    """An svg of matplotlib as an element of the page.

    What matplotlib writes is changed in five ways: ids carry the picture's name, so that several figures of a
    page never share one, and those nobody refers to are left out; style attributes become plain attributes,
    since a strict content policy forbids styles that are not in its list; style sheets, which would hold for
    the whole page, and metadata are left out; coordinates are rounded to 0.01 pt; title and description are
    added.
    """
    root = ET.fromstring(text)
    _plain_names(root)
    used = _references(root)
    for element in root.iter():
        for key, value in list(element.attrib.items()):
            if key == "id":
                del element.attrib[key]
                if value in used:
                    element.set("id", f"{picture.name}-{value}")
            elif key == "href":
                element.set(key, value if value.startswith("data:") else f"#{picture.name}-{value[1:]}")
            elif key == "style":
                del element.attrib[key]
                for name, text in _declared(value):
                    element.set(name, text)
        for key, value in element.attrib.items():
            value = _REFERENCE.sub(lambda found: f"url(#{picture.name}-{found.group(1)})", value)
            if key in ("d", "x", "y"):
                value = _NUMBER.sub(lambda found: f"{float(found.group()):.2f}", value)
            element.attrib[key] = value
    _name(root, picture)
    width, height = (float(root.attrib[side].removesuffix("pt")) / 72.0 for side in ("width", "height"))
    for key, value in _size(width, height, alone).items():
        root.set(key, value)
    return ET.tostring(root, encoding="unicode")


def _plain_names(root: ET.Element) -> None:
    """Names without their namespaces, as HTML has them, and without what does not belong in a page."""
    for element in root.iter():
        for child in list(element):
            if child.tag.rpartition("}")[2] in DROPPED:
                element.remove(child)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
        if _XLINK in element.attrib:
            element.set("href", element.attrib.pop(_XLINK))


def _references(root: ET.Element) -> set[str]:
    """Ids that something refers to."""
    found = set()
    for element in root.iter():
        for key, value in element.attrib.items():
            if key == "href" and value.startswith("#"):
                found.add(value[1:])
            found.update(_REFERENCE.findall(value))
    return found


def _declared(style: str) -> list[tuple[str, str]]:
    """The declarations of a style attribute as attributes; the short form of a font in its parts."""
    found = []
    for declaration in style.split(";"):
        name, _, value = declaration.partition(":")
        name, value = name.strip(), value.strip()
        if name == "font" and (parts := _FONT.fullmatch(value)):
            words = parts["before"].split()
            found += [
                ("font-weight" if word[0].isdigit() or word == "bold" else "font-style", word)
                for word in words
            ]
            found += [("font-size", f"{parts['size']}px"), ("font-family", FAMILY)]
        elif name:
            found.append((name, FAMILY if name == "font-family" else value))
    return found


def _name(root: ET.Element, picture: Picture) -> None:
    """What it is called and what can be seen on it."""
    for key, value in _named(picture).items():
        root.set(key, value)
    root.set("stroke-linejoin", "round")
    for place, (tag, text) in enumerate((("title", picture.title), ("desc", picture.description))):
        element = ET.Element(tag, {"id": f"{picture.name}-{'title' if place == 0 else 'description'}"})
        element.text = text
        root.insert(place, element)


def _named(picture: Picture) -> dict[str, str]:
    return {"role": "img", "aria-labelledby": f"{picture.name}-title {picture.name}-description"}


def _size(width: float, height: float, alone: bool) -> dict[str, str]:
    """How large it is, from inches, where there is room: wide ones are scrolled in a narrow window."""
    width, height = PIXELS * width, PIXELS * height
    scale = LARGER if alone and width <= SMALL else 1.0
    wide = {"class": "wide widest" if width > WIDEST else "wide"} if width > WIDE else {}
    return {"width": f"{scale * width:.0f}", "height": f"{scale * height:.0f}", **wide}
