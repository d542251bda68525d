"""Work-precision diagrams: error against time, both logarithmic."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ifrfit.cost.inference_costs import OTHER_QUESTION
from ifrfit.cost.report.text import error_text, method_name
from ifrfit.cost.result import Choice, Costs
from ifrfit.cost.timing import Kind
from ifrfit.errors import UsageError
from ifrfit.report import style
from ifrfit.report.provenance import is_stand_in, kinds_of, provenance_words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_MM = 110.0
FRONT_LABEL = "Pareto front"
ASIDE = "† asks another question: its distance from the posterior is no error of arithmetic"
_Y_LABELS = {
    "inference": "largest error of mean, sd, 95 % interval\n(posterior sd)",
    "physics": "largest error of β",
    "arithmetic": "largest error",
}
_X_LABELS = {
    "inference": "time, data to numbers (s)",
    "physics": "time an impact (s)",
    "arithmetic": "time an impact (s)",
}
_SHORT = 18  # letters of a setting that is written beside its marker
_LOST = 1e-5  # error in arithmetic from which on impacts are named
_LEAST = 1e-17  # smaller errors are drawn here, with their number
_NEAR = 4.0  # factor between errors within which labels would overlap


def plot(costs: Costs, kind: Kind) -> Figure:
    """Draw one kind.

    Each choice is a marker with the spread of its time, settings of a method are joined; filled markers and
    the grey steps are the Pareto front. In arithmetic each kind of impacts is a question of its own, joined
    from one precision to the other.

    Returns
    -------
    matplotlib.figure.Figure
        110 mm wide, not known to pyplot.

    Raises
    ------
    UsageError
        If that kind was not measured.
    """
    choices = [choice for choice in costs.of(kind) if not math.isnan(choice.error)]
    if not choices:
        raise UsageError(f"Nothing of the kind {kind} was measured.")
    methods = list(dict.fromkeys(choice.method for choice in choices))
    series_styles = style.series_styles(methods)
    title = _title(costs, kind)
    rows = 1 + math.ceil((len(methods) + 2) / 3)
    with style.drawing():
        height = 2.7 + 0.15 * (title.count("\n") + 1) + 0.16 * rows
        figure = style.new_figure(WIDTH_MM, height, "constrained")
        axes = figure.add_subplot()
        middle = math.sqrt(min(c.time.median for c in choices) * max(c.time.median for c in choices))
        if kind == "arithmetic":
            _draw_questions(axes, choices)
        else:
            _front(axes, choices)
        if kind == "inference" and costs.reference is not None and costs.reference.error > 0.0:
            # below the reference's own error nothing is claimed
            look: dict[str, Any] = {"color": style.GREY, "lw": 0.8, "zorder": 1}
            axes.axhline(costs.reference.error, ls=(0, (1, 2)), label="error of the reference", **look)
        for method in methods:
            own = [c for c in choices if c.method == method]
            _draw(axes, own, series_styles[method])
            if kind != "arithmetic" and len(own) > 1 and method not in OTHER_QUESTION:
                _name_ends(axes, own, middle)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel(_X_LABELS[kind])
        axes.set_ylabel(_Y_LABELS[kind])
        axes.margins(x=0.09, y=0.08)
        if is_stand_in(costs.fit):
            style.write_watermark(axes, size=26.0)
        figure.suptitle(title, fontsize=7.5, weight="bold" if is_stand_in(costs.fit) else "normal")
        figure.legend(
            loc="outside lower center", ncols=3, fontsize=6.6, handlelength=2.4, title_fontsize=6.4,
            title=ASIDE if any(method in OTHER_QUESTION for method in methods) else None,
        )  # fmt: skip
        style.fix_layout(figure)
    return figure


def _title(costs: Costs, kind: Kind) -> str:
    fit = costs.fit
    names = ", ".join(f"{s.name} ({provenance_words(kinds_of(fit, s))})" for s in fit.inputs)
    about = costs.about.get(kind, "")
    text = f"{names}: what accuracy costs, {kind}" + (f"; {about}" if about else "")
    if is_stand_in(fit):
        text = f"STAND-IN data. {text}"
    return style.filled(text, WIDTH_MM)


def _front(axes: Axes, choices: Sequence[Choice]) -> None:
    """Steps: the least error that is to be had within a time."""
    front = sorted((c for c in choices if c.on_front), key=lambda c: c.time.median)
    x, y = [c.time.median for c in front], [max(c.error, _LEAST) for c in front]
    right = max(c.time.high for c in choices)
    axes.step([*x, right], [*y, y[-1]], where="post", color="0.75", lw=3.0, zorder=1, label=FRONT_LABEL)


def _draw(axes: Axes, choices: Sequence[Choice], series_style: style.SeriesStyle) -> None:
    """One method: settings joined in their order, the spread of the times, filled where on the front."""
    x, y = [c.time.median for c in choices], [max(c.error, _LEAST) for c in choices]
    method = choices[0].method
    axes.plot(x, y, color=series_style.colour, ls=series_style.line, lw=1.0, zorder=3)
    for choice, a, b in zip(choices, x, y, strict=True):
        draw_choice(axes, (a, choice.time.low, choice.time.high), b, series_style, filled=choice.on_front)
        if choice.error < _LEAST:
            axes.annotate(
                f"{error_text(choice.error)} ↓", (a, b), xytext=(2, -9), textcoords="offset points",
                fontsize=5.8, color=style.GREY, ha="right", zorder=5,
            )  # fmt: skip
    label = method_name(method) + (" †" if method in OTHER_QUESTION else "")
    own: dict[str, Any] = {
        "color": series_style.colour,
        "ls": series_style.line,
        "marker": series_style.marker,
    }
    axes.plot([], [], ms=4.5, label=label, **own)


def draw_choice(
    axes: Axes,
    times: tuple[float, float, float],
    y: float,
    own: style.SeriesStyle,
    *,
    filled: bool,
    **more: Any,
) -> None:
    """Draw a marker at the median of some times, with their least and largest as a bar."""
    x, low, high = times
    axes.errorbar(
        x, y, xerr=[[x - low], [high - x]], fmt="none", ecolor=own.colour, elinewidth=0.8, capsize=1.5,
        zorder=2,
    )  # fmt: skip
    face = own.colour if filled else "white"
    look: dict[str, Any] = {"marker": own.marker, "ms": 4.5, "mfc": face, "mec": own.colour, "mew": 0.9}
    axes.plot(x, y, ls="none", zorder=4, **look, **more)


def _name_ends(axes: Axes, choices: Sequence[Choice], middle: float) -> None:
    """Settings of the first and the last marker of a line, where they are short; turned inwards."""
    for choice, up in ((choices[0], 4), (choices[-1], -9)):
        if len(choice.setting) <= _SHORT:
            right = choice.time.median > middle
            axes.annotate(
                choice.setting, (choice.time.median, max(choice.error, _LEAST)),
                xytext=(-4 if right else 4, up), textcoords="offset points", fontsize=5.8,
                color=style.GREY, ha="right" if right else "left", zorder=5,
            )  # fmt: skip


def _draw_questions(axes: Axes, choices: Sequence[Choice]) -> None:
    """Precisions: the same impacts joined from one to the other; those that lose most are named."""
    for question in dict.fromkeys(choice.question for choice in choices):
        own = [choice for choice in choices if choice.question == question]
        axes.plot(
            [c.time.median for c in own], [max(c.error, _LEAST) for c in own], color="0.75", lw=0.7, zorder=1
        )
    labels: list[tuple[float, float, list[str]]] = []  # neighbours share a line
    for choice in sorted(choices, key=lambda choice: (choice.time.median, -choice.error)):
        if choice.error > _LOST:
            worst = max(choice.errors, key=lambda name: choice.errors[name])
            x, y = choice.time.high, choice.error
            if not labels or labels[-1][0] != x or labels[-1][1] > _NEAR * y:
                labels.append((x, y, []))
            labels[-1][2].append(f"{choice.setting}: {worst}")
    for x, y, words in labels:
        axes.annotate(
            "; ".join(words), (x, y), xytext=(5, -2), textcoords="offset points", fontsize=5.8,
            color=style.GREY, zorder=5,
        )  # fmt: skip
