"""A section and a format of one's own, and what is refused."""

from __future__ import annotations

import pytest

from ifrfit.errors import UsageError
from ifrfit.registry import register, registered
from ifrfit.report.page import assemble, write_report
from ifrfit.report.page.blocks import Paragraph
from ifrfit.report.page.plugins import GENERATOR, ReportFormat, ReportSection


def count(given):
    return (Paragraph(f"{len(given.result.points)} rows, {len(given.appraisal.draws)} draws."),)


def headings(report, stem):
    return {f"{stem}.txt": "\n".join([GENERATOR, *(each.title for each in report.sections)]).encode()}


def test_a_section_of_ones_own_is_on_the_page_or_left_out(results, appraisals):
    with registered(
        ReportSection("never", "Never", lambda given: None), ReportSection("count", "How many", count)
    ):
        sections = assemble(results("lsq"), appraisals("lsq")).sections
    own = sections[-1]
    assert (own.name, own.title, own.blocks[0].text) == ("count", "How many", "24 rows, 2000 draws.")
    assert sections[-2].name == "repeat"
    with pytest.raises(UsageError, match="There is a report section 'repeat' already"):
        register(ReportSection("repeat", "Again", count))


def test_a_format_of_ones_own_is_written_and_replaced(results, appraisals, tmp_path):
    path = tmp_path / "report.txt"
    with registered(ReportFormat("txt", headings)):
        for _ in range(2):  # the first one is known as a report
            assert write_report(results("lsq"), appraisals("lsq"), path) == ["report.txt"]
    assert path.read_text().splitlines()[:2] == [GENERATOR, "Constants"]
    with pytest.raises(UsageError, match=r"a report ends in \.html, \.md, \.pdf\."):
        write_report(results("lsq"), appraisals("lsq"), path)
