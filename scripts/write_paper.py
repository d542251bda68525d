"""Write docs/paper.md from the package's own table of the paper's figures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ifrfit.data.descriptor import read_package
from ifrfit.data.locations import entry
from ifrfit.paper.cases import case_named
from ifrfit.paper.figures import PaperFigure
from ifrfit.paper.figures import PAPER

PAGE = Path(__file__).resolve().parent.parent / "docs" / "paper.md"

HEAD = """# The paper, figure by figure

Written by `scripts/write_paper.py` from the table in the code.

A. Doménech-Carbó, *On the friction/tangential restitution problem: Independent friction-restitution
modeling of sphere rebound with arbitrary spin* (2023). `make reproduce` or `ifrfit reproduce --out DIR`
redraws every figure with corrected equations ([errata](errata.md) lists the misprints); `--figure 5` draws
one, `--digitised-only` leaves out whatever does not rest on points that were digitised or measured.

The points of the five experiments are not published as numbers. **Stand-ins** take their place, generated
from the constants and conditions that the paper prints: a fit to them shows that the tool works, and
nothing about steel, granite, glass or dust. Every such figure says so in the picture. Real points go in
with `ifrfit datasets install NAME FILE`; the figures, the table and the answers below then come from them,
by the same code.
"""

TABLE_HEAD = """
| figure | what the caption says | equations really used | constants | transition | provenance |
|---|---|---|---|---|---|
"""

TAIL = """
## What is drawn

- Points with sigma, open where they stick, filled where they slide; outliers ringed; the provenance in the
  legend.
- The line of the printed constants (black, dashed), and that of the constants recovered by the exact
  posterior, with its 68 and 95 % credible bands; dotted, the limits that hold 95 % of further measurements
  at the sigma of the data around them.
- Sticking shaded, the recovered transition with its 95 % interval, the printed transition dashed.
- Standardised residuals of the fit.

`figN.csv` beside each picture holds every curve, point and transition drawn: panel, kind (data,
printed_constants, recovered, as_printed, other), label, x, y, y_lo68, y_hi68, y_lo95, y_hi95, sigma,
provenance, with x and y in the units of the figure's axes. The limits for one more measurement are rows of
their own, with ", one more measurement" after the label; a transition is a row without y. Fig. 1 lists the
ends of its arrows in sphere radii; Fig. 2 holds no numbers. A second run writes the same bytes.

`constants.csv` and the printed table hold the constants of each fit: printed, recovered, interval, status,
identifiability, lack of fit, certificate, provenance, and what it says. For a stand-in that is whether the
fit recovers what was put in, never a finding.

## What only real points settle

- **Does one set of constants hold in sticking and in sliding?** Not answerable from stand-ins, which were
  made with one set. With real points the answer is no if the fit of one set shows lack of fit (p < 0.001),
  or if the evidence favours an e_t of its own for each regime by a factor of 20 or more. `kharaz-2001`
  answers it already: no below some six degrees, where microslip acts; yes from 15 degrees on, as far as its
  points tell.
- **mu 0.12 or 0.14?** The same ball and block have mu = 0.12 in Figs 3, 8 and 9 and 0.14 in Fig. 6. With a
  standard deviation of about 0.004 from each, the two differ. Both lines are drawn in Figs 3 and 6. The
  points of all three series settle it: `reproduce` weighs one mu against one for each series.
- **Contact point or centre in Fig. 4a?** Both readings are drawn, as printed and as recovered. With the
  printed constants held, points beyond 60 degrees tell them apart: the lines tend to 0.80 and 0.94. With
  free constants they do not: in sliding both readings are a constant plus a multiple of cot gamma, so e_t
  and mu make up for the difference until e_t meets a bound. The spin after, or mu measured by itself,
  settles it without the printed constants. `reproduce` gives the misfit of both readings with the printed
  constants, and the evidence with free ones.
- **e_t in Fig. 9.** The four values drawn in the paper are not printed. Ours are -0.98, as everywhere for
  this ball, and -0.99, -0.96 and -0.94, by choice. The dotted line of FR is IFR with e_t = -1, which is FR
  with beta0 = 2/5.
- **Yu & Tafti in Fig. 5.** Their equations are not openly published, so their triangles are left out. A
  comparison with an elastic-plastic rebound of our own belongs here and is not part of this version.

## Real data in the same figures

`kharaz-2001`, alumina spheres on glass, was read off published figures. `kharaz-beta`, `kharaz-psi-after`,
`kharaz-mu-app`, `kharaz-delta` show it as beta, psi_after, mu_app and delta. Measured were the centre's
restitution and the spin after; each gives the impulse by the balance of angular momentum, without any
closure, and the impulse gives the rest (mu_app and delta need e_n, which the figure states). The band is
that of the fit from 15 degrees on; grey points are left out of it, and the grey line, the fit to all
angles, is contradicted by them.
"""


def page() -> str:
    """The page's text."""
    notes = [f"- **{_called(figure)}** {figure.note}" for figure in PAPER if figure.note]
    return HEAD + TABLE_HEAD + "\n".join(_rows()) + "\n\n" + "\n".join(notes) + "\n" + TAIL


def _rows() -> Iterator[str]:
    for figure in PAPER:
        cells = (
            f"[{figure.name}](../figures/{figure.stem}.svg)",
            figure.says,
            figure.uses,
            _constants(figure),
            _transition(figure),
            _provenance(figure),
        )
        yield f"| {' | '.join(cells)} |"


def _called(figure: PaperFigure) -> str:
    return f"Fig. {figure.name}."


def _constants(figure: PaperFigure) -> str:
    if not figure.models:
        return ""
    return ", ".join(f"{name} = {value:.2f}" for name, value in figure.models[0].constants.items())


def _transition(figure: PaperFigure) -> str:
    if not figure.models:
        return ""
    if figure.x.spin:
        return "none: all slide"
    found = []
    for setting in figure.settings:
        angles = ", ".join(f"{a:.2f}°" for a in figure.models[0].transitions(setting)) or "none: all slide"
        found.append(f"{setting.series}: {angles}" if len(figure.settings) > 1 else angles)
    return "; ".join(found)


def _provenance(figure: PaperFigure) -> str:
    if figure.kind == "scheme":
        return "own drawing"
    if not figure.case:
        return "theory"
    dataset = case_named(figure.case).dataset
    return f"{read_package(entry(dataset).bundled)['ifrfit']['provenance']} (`{dataset}`)"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
