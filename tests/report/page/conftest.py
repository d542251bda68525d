"""Results with everything a report shows, their pages, and a browser to open them in."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_here import executable, lacking
from factories import impacts_file

import ifrfit
from ifrfit import FitResult
from ifrfit.inference.appraisal import Appraisal
from ifrfit.inference.appraise import appraise
from ifrfit.report.page import assemble
from ifrfit.report.page.blocks import Report
from ifrfit.report.page.html import render

WINDOW = {"width": 1200, "height": 900}
HOSTILE = (
    "<img src=x onerror=\"document.title='taken'\">",
    "</script><script>document.title='taken'</script>",
)


@pytest.fixture(scope="session")
def results(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], FitResult]:
    """Fits by name, each made once: fixed, loose, hostile, stand-in, digitised, lsq."""
    folder = tmp_path_factory.mktemp("impacts")
    gamma = np.linspace(3.0, 85.0, 24)
    one = {"gamma": gamma, "noise": 0.05, "c": -0.8}

    def make(name: str) -> FitResult:
        if name == "stand-in":
            return ifrfit.fit("cross-2019", fix={"e_n": 0.94}, command="ifrfit fit cross-2019 --fix e_n=0.94")
        if name == "digitised":
            return ifrfit.fit("kharaz-2001", prior={"e_n": (0.98, 0.01)}, gamma_min=15.0)
        if name == "hostile":
            # what separate constants cost grows with the rows, and with what they share
            few, given = {**one, "gamma": gamma[::2]}, {"e_n": 0.94, "e_t": -0.8}
            parts = (
                {**few, "series": HOSTILE[0]},
                {**few, "series": HOSTILE[1], "mu": 0.2, "spin_y": -0.3, "seed": 3},
            )
            path = impacts_file(folder / "hostile.csv", *parts)
            return ifrfit.fit(path, fix=given, separate="mu", command=f"ifrfit {HOSTILE[1]}")
        path = impacts_file(folder / "impacts.csv", one)
        if name == "loose":
            return ifrfit.fit(path)
        return ifrfit.fit(path, fix={"e_n": 0.94}, method="lsq" if name == "lsq" else "exact")

    return functools.cache(make)


@pytest.fixture(scope="session")
def appraisals(results: Callable[[str], FitResult]) -> Callable[[str], Appraisal]:
    """Their appraisals, each computed once, closures not compared."""
    return functools.cache(lambda name: appraise(results(name), closures=False))


@pytest.fixture(scope="session")
def compared(results: Callable[[str], FitResult]) -> Appraisal:
    """The appraisal of one of them, closures compared."""
    return appraise(results("fixed"))


@pytest.fixture(scope="session")
def reports(
    results: Callable[[str], FitResult], appraisals: Callable[[str], Appraisal]
) -> Callable[[str], Report]:
    """The reports of these results, each put together once."""
    return functools.cache(lambda name: assemble(results(name), appraisals(name)))


@pytest.fixture(scope="session")
def pages(reports: Callable[[str], Report]) -> Callable[[str], str]:
    """Their pages, each rendered once."""
    return functools.cache(lambda name: render(reports(name)))


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """A headless Chromium; tests that ask for it are not collected where there is none."""
    if lacking():
        pytest.fail(f"IFRFIT_NEEDS_BROWSER is set, but {lacking()}.")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        launched = driver.chromium.launch(executable_path=executable())
        yield launched
        launched.close()


@pytest.fixture(scope="session")
def shared_tab(browser: Any) -> Any:
    """A tab that one test after another uses: a new one costs more than the page in it."""
    return browser.new_context(viewport=WINDOW).new_page()


class Opened:
    """A page in a browser, and all that it complained about or asked for."""

    def __init__(self, tab: Any, text: str, folder: Path) -> None:
        self.tab = tab
        self.said: list[str] = []
        self.asked: list[str] = []
        self._heard = {
            "console": lambda message: self.said.append(message.text),
            "pageerror": lambda error: self.said.append(str(error)),
            "request": lambda request: self.asked.append(request.url),
        }
        for event, heard in self._heard.items():
            tab.on(event, heard)
        path = folder / "report.html"
        path.write_text(text, encoding="utf-8")
        tab.goto(path.as_uri())

    def leave(self) -> None:
        """Leave the tab as it was."""
        for event, heard in self._heard.items():
            self.tab.remove_listener(event, heard)
        self.tab.goto("about:blank")

    def text(self, name: str) -> str:
        return str(self.tab.text_content(f"#explorer-{name}"))

    def attribute(self, name: str, attribute: str) -> str:
        return str(self.tab.get_attribute(f"#explorer-{name}", attribute))

    def move(self, name: str, value: float) -> None:
        """Move a slider."""
        self.tab.evaluate(
            "([name, value]) => { const s = document.getElementById(name); s.value = value;"
            " s.dispatchEvent(new Event('input')); }",
            [f"explorer-{name}", value],
        )


@pytest.fixture
def opened(browser: Any, shared_tab: Any, tmp_path: Path) -> Iterator[Callable[..., Opened]]:
    """Open a page; options of the browser, and every page but the first, get a context of their own."""
    contexts, shared = [], []

    def show(text: str, **options: Any) -> Opened:
        if not options and not shared:
            shared.append(Opened(shared_tab, text, tmp_path))
            return shared[0]
        context = browser.new_context(**{"viewport": WINDOW, **options})
        contexts.append(context)
        return Opened(context.new_page(), text, tmp_path)

    yield show
    for page in shared:
        page.leave()
    for context in contexts:
        context.close()
