"""What plugs into a report: a section, and a format of its files.

Both are entries of a registry (`ifrfit.report.page.registries`): one file here and one line there, or
`ifrfit.register(...)` from anywhere else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from ifrfit.report.page.blocks import Block, Report
from ifrfit.report.page.report_input import ReportInput

# every report holds it, near its beginning, so that a later one may take its place
GENERATOR = "ifrfit report"


class SectionBuilder(Protocol):
    """Builds the content of a section."""

    def __call__(self, given: ReportInput, /) -> Sequence[Block] | None:
        """Blocks in order; None leaves the section out of this report."""


class FormatWriter(Protocol):
    """Writes a report in one format."""

    def __call__(self, report: Report, stem: str, /) -> Mapping[str, bytes]:
        """Files by name, the report itself first, whose name is ``stem`` with the suffix of the format.

        The same report gives the same bytes. The report itself holds `GENERATOR` in its first 4,096
        bytes, or it would not be replaced by the next one; pictures beside it are in a folder
        ``stem-...``.
        """


@dataclass(frozen=True)
class ReportSection:
    """A section: its name (anchor of the page), its heading, and what builds it.

    Attributes
    ----------
    name, title : str
    build : SectionBuilder
    beside : frozenset of str
        Kinds of its blocks that stand in a second column where the page is wide.
    """

    name: str
    title: str
    build: SectionBuilder
    beside: frozenset[str] = frozenset()


@dataclass(frozen=True)
class ReportFormat:
    """A format: its name, which is the suffix of its files without the dot, and what writes it."""

    name: str
    write: FormatWriter
