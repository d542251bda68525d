"""Reports as files: Markdown, many at once; what lies there of others stays."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from refusals import refused

from ifrfit.errors import UsageError
from ifrfit.registry import registered
from ifrfit.report.page import write_batch, write_report
from ifrfit.report.page.batch import index, named_entries
from ifrfit.report.page.html import fill
from ifrfit.report.page.markdown import escaped, markdown_files
from ifrfit.report.page.plugins import GENERATOR, ReportFormat
from ifrfit.report.page.registries import FORMATS

KINDS = {"html": b"<!DOCTYPE html>", "md": b"<!-- ifrfit report -->"}


@pytest.mark.usefixtures("small_page")
@pytest.mark.parametrize("suffix", FORMATS)
def test_a_report_is_written_and_replaced_but_nothing_else_is(results, appraisals, tmp_path, suffix):
    path = tmp_path / "deep" / f"report.{suffix}"
    write_report(results("lsq"), appraisals("lsq"), path)
    first = path.read_bytes()
    assert first.startswith(KINDS.get(suffix, b""))
    assert [p.name for p in path.parent.iterdir() if p.name.startswith(".")] == []
    write_report(results("lsq"), appraisals("lsq"), path)
    assert path.read_bytes() == first
    path.write_bytes(b"mine")
    with refused(UsageError, match="is not a report of ifrfit; add --force to replace it"):
        write_report(results("lsq"), appraisals("lsq"), path)
    assert path.read_bytes() == b"mine"
    write_report(results("lsq"), appraisals("lsq"), path, force=True)
    assert path.read_bytes() == first


@pytest.mark.usefixtures("small_page")
def test_a_format_without_the_mark_is_not_replaced(results, appraisals, tmp_path):
    """Control: what each of `FORMATS` must put at the beginning of its file."""
    with registered(ReportFormat("bare", lambda report, stem: {f"{stem}.bare": b"bare"})):
        write_report(results("lsq"), appraisals("lsq"), tmp_path / "report.bare")
        with refused(UsageError, match="is not a report of ifrfit"):
            write_report(results("lsq"), appraisals("lsq"), tmp_path / "report.bare")
    assert GENERATOR.encode() not in (tmp_path / "report.bare").read_bytes()


@pytest.mark.usefixtures("small_page")
def test_a_folder_that_cannot_be_written_is_said(results, appraisals, tmp_path):
    (tmp_path / "taken").write_text("a file")
    with refused(UsageError, match=r"taken is a file\. Name a folder with --out"):
        write_report(results("lsq"), appraisals("lsq"), tmp_path / "taken" / "report.md")
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def test_markdown_has_its_pictures_beside_it(reports):
    files = markdown_files(reports("hostile"), "my report")
    text = files["my report.md"].decode()
    pictures = re.findall(r"\]\((my%20report-figures/[^)]+)\)", text)
    assert {name.replace("%20", " ") for name in pictures} == set(files) - {"my report.md"}
    pictures = [content for name, content in files.items() if name.endswith(".svg")]
    assert len(pictures) == len(files) - 1
    assert {ET.fromstring(content).tag for content in pictures} == {"{http://www.w3.org/2000/svg}svg"}
    # names from the file are escaped; in a block of code, indented, nothing needs to be
    prose = [line for line in text.splitlines()[1:] if not line.startswith("    ")]
    assert [line for line in prose if re.search(r"(?<!\\)<", line)] == []
    rows = [line for line in text.splitlines() if line.startswith("|")]
    unescaped = [len(re.findall(r"(?<!\\)\|", row)) for row in rows]
    assert unescaped[0] == unescaped[1] == 7
    assert escaped("a|b\n<c>") == r"a\|b \<c\>"


def test_names_in_a_batch_are_unique_and_safe(results):
    paths = ("a/result.json", "b/a.json", "c/A.json", "d/index.json", "x/<img>.json", "y/..json")
    entries = named_entries([(Path(path), results("lsq")) for path in paths], "html")
    names = [entry.name for entry in entries]
    assert names[:4] == ["a", "a-2", "A-3", "index-2"]
    assert len({name.lower() for name in names}) == len(names)
    assert all(re.fullmatch(r"[\w.-]+", name) for name in names)


@pytest.mark.usefixtures("small_page")
def test_a_batch_has_an_index_of_all(results, appraisals, tmp_path):
    out = tmp_path / "reports"
    some = [(Path("one.json"), results("lsq")), (Path("two.json"), results("loose"))]
    told: list[str] = []
    assert write_batch(some, lambda _: appraisals("lsq"), out, suffix="md", progress=told.append) == [
        "index.html",
        "one.md",
        "two.md",
    ]
    assert told == ["one", "two"]
    text = (out / "index.html").read_text(encoding="utf-8")
    assert 'href="one.md"' in text
    assert "<small>not determined</small>" in text
    assert {p.name for p in out.iterdir()} == {
        "index.html", "one.md", "one-figures", "two.md", "two-figures"
    }  # fmt: skip
    (out / "two.md").write_text("mine")
    with refused(UsageError, match="is not a report"):
        write_batch(some, lambda _: appraisals("lsq"), out, suffix="md")
    assert (out / "two.md").read_text() == "mine"


def test_the_index_sorts_and_does_no_harm(results, opened):
    entries = named_entries(
        [(Path(f"{n}.json"), results(n)) for n in ("fixed", "loose", "hostile", "digitised")], "html"
    )
    shown = opened(index(entries))
    heads = shown.tab.locator("#results thead button").all_text_contents()
    column = heads.index("e_t")

    def keys():
        cells = shown.tab.locator(f"#results tbody tr > :nth-child({column + 1})")
        return cells.evaluate_all("cells => cells.map(cell => cell.dataset.key)")

    button = shown.tab.locator("#results thead button").nth(column)
    button.click()
    assert keys() == sorted(keys(), key=float)
    button.press("Enter")
    assert keys() == sorted(keys(), key=float, reverse=True)
    open_ones = shown.tab.locator("#results thead button").nth(heads.index("mu"))
    open_ones.click()
    mu = shown.tab.locator(f"#results tbody tr > :nth-child({heads.index('mu') + 1})")
    assert mu.evaluate_all("cells => cells.map(cell => cell.dataset.key)")[-1] == ""
    assert shown.said == []
    assert shown.tab.title() == "4 results compared"
    ids = shown.tab.evaluate("[...document.querySelectorAll('[id]')].map(element => element.id)")
    assert len(ids) == len(set(ids))


def test_a_template_refuses_what_it_is_not_given():
    from jinja2 import UndefinedError

    with pytest.raises(UndefinedError):
        fill("report.html.j2", script="")
