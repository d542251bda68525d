"""What a report consists of, before anybody decides whether it becomes HTML or Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ifrfit.report.page.charts.chart import Chart

Tone = Literal["plain", "look", "stand-in", "note"]


@dataclass(frozen=True)
class Paragraph:
    """A few sentences.

    Attributes
    ----------
    text : str
    tone : {"plain", "look", "stand-in", "note"}
        What nobody may overlook is marked by more than a colour.
    """

    text: str
    tone: Tone = "plain"
    kind: ClassVar[str] = "paragraph"


@dataclass(frozen=True)
class Findings:
    """Facts as (LOOK, ok or note; sentence)."""

    items: tuple[tuple[str, str], ...]
    kind: ClassVar[str] = "findings"


@dataclass(frozen=True)
class Table:
    """A table whose first column names its rows.

    Attributes
    ----------
    caption : str
    head : tuple of str
    rows : tuple of tuple of str
    numbers : frozenset of int
        Columns that are aligned to the right.
    folded : bool
        Long enough to be shown on request where the medium can.
    is_verbatim : bool
        Whether names are those of columns and files: media that typeset symbols leave them as they are.
    """

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers: frozenset[int] = frozenset()
    folded: bool = False
    is_verbatim: bool = False
    kind: ClassVar[str] = "table"


@dataclass(frozen=True)
class Pairs:
    """Names with what belongs to them."""

    items: tuple[tuple[str, str], ...]
    kind: ClassVar[str] = "pairs"


@dataclass(frozen=True)
class Definition:
    """A symbol, what it means, and its formula.

    Attributes
    ----------
    symbol : str
        LaTeX, without dollars, of what `ifrfit.report.page.charts.typesetting` knows.
    words : str
    formula : str
        Likewise; empty where there is none.
    """

    symbol: str
    words: str
    formula: str = ""


@dataclass(frozen=True)
class Definitions:
    """Symbols with their meaning."""

    items: tuple[Definition, ...]
    kind: ClassVar[str] = "definitions"


@dataclass(frozen=True)
class Code:
    """A text to copy, with what it is.

    Attributes
    ----------
    words : str
    text : str
    is_command : bool
        Whether it is a command line, which media may break anywhere between words; else its lines stay.
    """

    words: str
    text: str
    is_command: bool = True
    kind: ClassVar[str] = "code"


@dataclass(frozen=True)
class Picture:
    """One chart or figure.

    Attributes
    ----------
    name : str
        Short and unique in the report: stem of files and prefix of ids.
    title : str
        What it shows, in a few words.
    description : str
        What can be seen on it, for those who cannot see it.
    figure : Chart, Figure or str
        A chart of the page (`ifrfit.report.page.charts`), or a figure of matplotlib; or the svg that
        matplotlib has written of one (`ifrfit.report.style.svg_text`).
    """

    name: str
    title: str
    description: str
    figure: Chart | Figure | str


@dataclass(frozen=True)
class Pictures:
    """Figures side by side as far as the medium is wide, with one caption."""

    items: tuple[Picture, ...]
    caption: str
    kind: ClassVar[str] = "pictures"


@dataclass(frozen=True)
class Panel:
    """The interactive panel: what its script needs to know. Media without script leave it out."""

    payload: Mapping[str, Any]
    kind: ClassVar[str] = "panel"


@dataclass(frozen=True)
class Download:
    """A file inside the page. Media without links leave it out."""

    name: str
    media: str
    content: str
    words: str
    kind: ClassVar[str] = "download"


Block = Paragraph | Findings | Table | Pairs | Definitions | Code | Pictures | Panel | Download


@dataclass(frozen=True)
class Section:
    """A part of the report under a heading of its own.

    Attributes
    ----------
    name, title : str
    blocks : tuple of Block
    beside : frozenset of str
        Kinds of blocks that stand beside the others where the medium is wide enough.
    """

    name: str
    title: str
    blocks: tuple[Block, ...]
    beside: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Badge:
    """A word or two at the very top: provenance, method, alarm."""

    text: str
    tone: Tone = "plain"


@dataclass(frozen=True)
class Report:
    """A whole report.

    Attributes
    ----------
    title : str
    badges : tuple of Badge
    verdict : tuple of str
        Two sentences: what was determined and how well, and what contradicts it.
    alarm : bool
        Whether anything needs attention.
    sections : tuple of Section
    footer : mapping of str to str
        Version and time, for the foot of the page.
    """

    title: str
    badges: tuple[Badge, ...]
    verdict: tuple[str, ...]
    alarm: bool
    sections: tuple[Section, ...]
    footer: Mapping[str, str] = field(default_factory=dict)
