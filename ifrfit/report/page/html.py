"""A report as one HTML page that needs nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from ifrfit.physics.observables import OBSERVABLES
from ifrfit.report import style
from ifrfit.report.page.blocks import Download, Report
from ifrfit.report.page.charts.typesetting import html as formula
from ifrfit.report.page.plugins import GENERATOR, ReportFormat
from ifrfit.report.page.sortable_table import cells
from ifrfit.report.page.svg import inline
from ifrfit.report.page.symbols import typeset
from ifrfit.report.templating import environment

if TYPE_CHECKING:
    from jinja2 import Environment

_OBSERVABLES = "/* observables */"  # where physics.js takes them


def render(report: Report) -> str:
    """The page: deterministic, and strict about what it may load and run, which is nothing from elsewhere.

    The content policy names the hash of the one style sheet and of the one script; without the panel there is
    no script at all. Whatever comes from data is escaped by the templates or, in figures, by the writer of
    the XML.
    """
    panels = any(block.kind == "panel" for section in report.sections for block in section.blocks)
    return fill("report.html.j2", script=panel_script() if panels else "", report=report)


def fill(template: str, *, script: str, **content: Any) -> str:
    """A template with the style sheet, a script and their policy.

    Parameters
    ----------
    template : str
        Its file name.
    script : str
        Source of the script, empty for a page without.
    **content
        What the template shows.
    """
    sheet = colours() + asset("page.css")
    return (
        page_environment()
        .get_template(template)
        .render(sheet=sheet, script=script, policy=policy(sheet, script), generator=GENERATOR, **content)
    )


def page_environment() -> Environment:
    """Templates with the filters of pages."""
    found = environment()
    found.filters["cells"] = cells
    found.filters["data_uri"] = data_uri
    found.filters["picture"] = _picture
    found.filters["typeset"] = _typeset
    found.filters["formula"] = _formula
    return found


def asset(*names: str) -> str:
    """Style sheets or scripts of the package, one after the other."""
    folder = files("ifrfit.report.page").joinpath("assets")
    return "\n".join(folder.joinpath(name).read_text(encoding="utf-8") for name in names)


def physics_script() -> str:
    """The rebound in JavaScript, with every observable that has an expression for the panel."""
    known = [f"    {each.name}: (r) => {each.panel},\n" for each in OBSERVABLES.values() if each.panel]
    return asset("physics.js").replace(_OBSERVABLES, f"\n{''.join(known)}  ")


def panel_script() -> str:
    """The script of a page with a panel."""
    return f"{physics_script()}\n{asset('explorer.js')}"


def policy(sheet: str, script: str) -> str:
    """Content-Security-Policy of a page with this style sheet and this script, and nothing else."""
    allowed = f"'{_hash(script)}'" if script else "'none'"
    return (
        f"default-src 'none'; style-src '{_hash(sheet)}'; script-src {allowed}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def colours() -> str:
    """The colours of the figures as variables of the style sheet."""
    named = "".join(f"--c{i}:{colour};" for i, colour in enumerate(style.COLOURS))
    return f":root{{{named}}}\n"


def data_uri(download: Download) -> str:
    """A file as an address that holds it."""
    encoded = base64.b64encode(download.content.encode("utf-8")).decode("ascii")
    return f"data:{download.media};charset=utf-8;base64,{encoded}"


def _picture(picture: Any, alone: bool) -> Any:
    from markupsafe import Markup

    # our own figure, written by an XML writer that escapes every text
    return Markup(inline(picture, alone=alone))


def _typeset(text: str) -> Any:
    from markupsafe import Markup

    # escaped piece by piece
    return Markup(typeset(text))


def _formula(latex: str) -> Any:
    from markupsafe import Markup

    return Markup(formula(latex))


FORMAT = ReportFormat("html", lambda report, stem: {f"{stem}.html": render(report).encode("utf-8")})
