"""A figure as SVG that can stand in a page beside others: own ids, no style sheet, nothing from elsewhere."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING

from ifrfit.report.page.blocks import Picture
from ifrfit.report.style import svg_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_REFERENCE = re.compile(r"url\(#([^)]+)\)")
_FONT = re.compile(r"(?P<before>.*?)(?P<size>[\d.]+)px\s+(?P<family>.*)")
_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_XLINK = "{http://www.w3.org/1999/xlink}href"
DROPPED = ("metadata", "style")
PIXELS = 106.0  # an inch: a little larger than in print
WIDE = 480.0  # pixels from which a picture is scrolled rather than shrunk in a narrow window
SMALL, LARGER = 400.0, 1.45  # how wide a small figure is at most, and how much larger it is shown
# Verdana has nearly the widths of DejaVu Sans, which not every reader has
FAMILY = "DejaVu Sans, Verdana, sans-serif"


def inline(picture: Picture, *, alone: bool = False) -> str:
    """The figure of a picture as an ``svg`` element.

    What matplotlib writes is changed in five ways: ids carry the picture's name, so that several figures of a
    page never share one, and those nobody refers to are left out; style attributes become plain attributes,
    since a strict content policy forbids styles that are not in its list; style sheets, which would hold for
    the whole page, and metadata are left out; coordinates are rounded to 0.01 pt; title and description are
    added. A small figure that stands `alone` is shown larger.
    """
    root = ET.fromstring(svg_text(picture.figure))
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
    _size(root, picture.figure, alone)
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
    root.set("role", "img")
    root.set("aria-labelledby", f"{picture.name}-title {picture.name}-description")
    root.set("stroke-linejoin", "round")
    for place, (tag, text) in enumerate((("title", picture.title), ("desc", picture.description))):
        element = ET.Element(tag, {"id": f"{picture.name}-{'title' if place == 0 else 'description'}"})
        element.text = text
        root.insert(place, element)


def _size(root: ET.Element, figure: Figure, alone: bool) -> None:
    """How large it is where there is room; wide ones are scrolled in a narrow window, others shrink."""
    width, height = figure.get_size_inches() * PIXELS
    scale = LARGER if alone and width <= SMALL else 1.0
    root.set("width", f"{scale * width:.0f}")
    root.set("height", f"{scale * height:.0f}")
    if width > WIDE:
        root.set("class", "wide")
