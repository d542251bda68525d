"""Marginals and pairs of the constants."""

from __future__ import annotations

from collections.abc import Sequence

from ifrfit.inference.estimators import title_of
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.report.page.blocks import Block, Paragraph, Picture, Pictures, Table
from ifrfit.report.page.drawings.corner import draw_corner
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput

MOST = 6


def build(given: ReportInput) -> Sequence[Block] | None:
    """Corner plot of the draws, and the correlations; None where every constant is fixed."""
    result = given.result
    draws = given.appraisal.draws
    estimates = given.free | given.kappas
    names = [name for name in estimates if name in draws and draws[name].std() > 0.0]
    if not names:
        return None
    if not any(quantity_of(name) == "e_n" for name in given.free):
        # kappa is mu times a number then
        names = [name for name in names if not name.startswith("kappa")]
    shown = names[:MOST]
    columns = {name: draws[name].to_numpy(dtype=float) for name in shown}
    if result.state.sample is None:
        law = "the Gaussian around the optimum, cut at the bounds"
    else:
        law = f"the {title_of(result.method)}"
    left_out = f" Not shown: {', '.join(names[MOST:])}." if len(names) > MOST else ""
    described = "; ".join(
        f"{name}: mean {column.mean():.4g}, sd {column.std():.2g}" for name, column in columns.items()
    )
    blocks: list[Block] = [
        Pictures(
            (
                Picture(
                    "corner",
                    "Marginals and pairs",
                    f"{described}.",
                    draw_corner(columns, {name: estimates[name].interval95 for name in shown}),
                ),
            ),
            f"{len(draws)} draws of {law}. Diagonal: marginal, with its median and the stated 95 % interval "
            f"(dashed). Below: pairs with the contours that hold 68 % (solid) and 95 % (dashed).{left_out}",
        )
    ]
    labels, matrix = result.correlation.names, result.correlation.matrix
    if len(labels) > 1:
        rows = tuple(
            (label, *(f"{matrix[i, j]:+.3f}" for j in range(len(labels)))) for i, label in enumerate(labels)
        )
        blocks.append(
            Table(
                "Correlation of the free constants.",
                ("", *labels),
                rows,
                frozenset(range(1, len(labels) + 1)),
            )
        )
    if result.state.sample is None:
        blocks.append(
            Paragraph("This method has no posterior: the draws show the curvature at the optimum.", "note")
        )
    return blocks


SECTION = ReportSection("posterior", "Posterior", build)
