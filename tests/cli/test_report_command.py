"""ifrfit report: where the page goes, what is refused, and what is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from ifrfit.report.page.registries import FORMATS


@pytest.fixture
def fitted(cli, impacts):
    path = impacts(gamma=range(5, 85, 6), sigma=0.05, noise=0.05)
    return ("fit", path, "--fix", "e_n=0.94", "--method", "lsq")


@pytest.fixture
def result(cli, fitted):
    """A result.json without its figures."""
    path = Path("results/result.json")
    path.parent.mkdir()
    path.write_text(cli(*fitted, "--json").stdout, encoding="utf-8")
    return path


def test_fit_writes_four_files_and_report_the_same_page_again_closures_compared(cli, fitted):
    found = cli(*fitted, "--out", "deep/results")
    assert found.returncode == 0
    assert found.stdout.endswith("\n\nwritten: deep/results/  result.json  fit.svg  fit.png  report.html\n")
    four = ["fit.png", "fit.svg", "report.html", "result.json"]
    assert [path.name for path in Path("deep").iterdir()] == ["results"]
    assert sorted(path.name for path in Path("deep/results").iterdir()) == four
    written = Path("deep/results/report.html").read_text(encoding="utf-8")
    own = written.split('<section id="closures"')[1].split("</section>", 1)[0]
    assert [name for name in ("F", "FR", "IFR", "IFR-contact", "MAW") if f">{name}<" not in own] == []
    found = cli("report", "deep/results/result.json")
    assert (found.returncode, found.stderr) == (0, "")
    assert found.stdout == "written: deep/results/report.html\n"
    assert Path("deep/results/report.html").read_text(encoding="utf-8") == written
    assert sorted(path.name for path in Path("deep/results").iterdir()) == four


@pytest.mark.usefixtures("small_page")
def test_the_form_follows_the_option_or_the_name(cli, result):
    assert cli("report", result, "--format", "md").stdout == "written: results/report.md\n"
    assert [path.suffix for path in Path("results/report-figures").iterdir()] == [".svg"]
    assert cli("report", result, "--out", "mine.md").stdout == "written: mine.md\n"
    assert Path("mine.md").read_bytes().startswith(b"<!-- ifrfit report -->")
    assert cli("report", result, "--out", "folder", "--quiet").stdout == ""
    assert Path("folder/report.html").exists()


@pytest.mark.usefixtures("small_page")
def test_several_results_make_an_index(cli, result):
    Path("second.json").write_bytes(result.read_bytes())
    found = cli("report", result, "second.json", "--out", "all")
    assert found.stdout == "written: all/  index.html and 2 reports\n"
    assert sorted(path.name for path in Path("all").iterdir()) == [
        "index.html",
        "results.html",
        "second.html",
    ]


@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [
        (("nix.json",), 3, "nix.json: there is no such file. Name the result.json of a fit."),
        (("broken.txt",), 3, "broken.txt, line 1, column 1: this is not JSON"),
        (
            ("results/result.json", "--format", "doc"),
            2,
            "--format doc: a report is {formats}; choose one",
        ),
        (
            ("results/result.json", "--format", "pdf"),
            2,
            "--format pdf: a report is {formats}; print the page from a browser for a PDF.",
        ),
        (("results/result.json", "--out", "a.md", "--format", "html"), 2, "--out a.md does not end in .html"),
        (("results/result.json", "--out", "a.doc"), 2, "a.doc: a report is {formats}; choose one of them."),
        (
            ("results/result.json", "results/result.json"),
            2,
            "Several results need a folder for their reports",
        ),
        (
            ("results/result.json", "--out", "notes.html"),
            2,
            "notes.html is not a report of ifrfit; add --force",
        ),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(cli, result, arguments, status, says):
    for name in ("notes.html", "broken.txt"):
        Path(name).write_text("mine", encoding="utf-8")
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    found = cli("report", *arguments)
    assert (found.returncode, found.stdout) == (status, "")
    assert found.stderr.startswith("ifrfit: " + says.format(formats=", ".join(FORMATS)))
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before
