"""A section and a format of one's own, and what is refused."""

from __future__ import annotations

import re

import pytest
from extensions.format import FORMAT
from extensions.section import SECTION

from ifrfit.errors import UsageError
from ifrfit.registry import register, registered
from ifrfit.report.page import assemble, write_report
from ifrfit.report.page.plugins import GENERATOR, ReportSection
from ifrfit.report.page.registries import FORMATS


def test_a_section_of_ones_own_is_on_the_page_or_left_out(results, appraisals):
    with registered(ReportSection("never", "Never", lambda given: None), SECTION):
        sections = assemble(results("lsq"), appraisals("lsq")).sections
    own = sections[-1]
    assert (own.name, own.title, own.blocks[0].text) == ("count", "How many", "24 rows, 2000 draws.")
    assert sections[-2].name == "repeat"
    with pytest.raises(UsageError, match="There is a report section 'repeat' already"):
        register(ReportSection("repeat", "Again", SECTION.build))


def test_a_format_of_ones_own_is_written_and_replaced(results, appraisals, tmp_path):
    path = tmp_path / "report.toc"
    with registered(FORMAT):
        for _ in range(2):  # the first one is known as a report
            assert write_report(results("lsq"), appraisals("lsq"), path) == ["report.toc"]
    assert path.read_text().splitlines()[:2] == [GENERATOR, "Constants"]
    with pytest.raises(
        UsageError, match=re.escape(f"report.toc: a report is {', '.join(FORMATS)}; choose one")
    ):
        write_report(results("lsq"), appraisals("lsq"), path)
