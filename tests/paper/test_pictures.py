"""The pictures: width, units, words that nobody may overlook, nothing cut, the same bytes."""

from __future__ import annotations

import pytest
from factories import cut_off, rest_long, texts_of

from ifrfit.paper.figures import FIGURES
from ifrfit.paper.schemes import draw_springs
from ifrfit.report.style import save_figure

DRAWN = [f.name for f in FIGURES]
WITH_AXES = [f.name for f in FIGURES if f.kind != "scheme"]
OF = {figure.name: figure for figure in FIGURES}


@pytest.mark.parametrize("name", rest_long(DRAWN, 8))
def test_it_is_as_wide_as_a_column_and_nothing_is_cut(picture, name):
    figure = picture(name).figure
    width = 174.0 if name == "1" else 85.0
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(width)
    assert cut_off(figure) == []


@pytest.mark.parametrize("name", WITH_AXES)
def test_every_axis_says_its_unit(picture, name):
    shown = [axes for axes in picture(name).figure.axes if axes.axison]
    data = shown[0]
    assert data.get_ylabel().endswith(("(deg)", "(–)"))
    lowest = shown[-1]
    assert any(unit in lowest.get_xlabel() for unit in ("(deg)", "(–)"))
    if OF[name].kind != "theory":
        assert [axes.get_ylabel() for axes in shown[1:]] == ["residual (σ)"]


@pytest.mark.parametrize("name", WITH_AXES)
def test_a_stand_in_says_so_in_the_picture_and_nothing_else_does(picture, name):
    said = "\n".join(texts_of(picture(name).figure))
    if OF[name].kind == "points":
        assert "STAND-IN DATA, not an experiment" in picture(name).figure._suptitle.get_text()
        assert "(STAND-IN, not measured)" in said
        mark = next(t for t in picture(name).figure.axes[0].texts + picture(name).figure.axes[-1].texts
                    + picture(name).figure.axes[1].texts if t.get_text() == "STAND-IN")  # fmt: skip
        assert mark.get_fontsize() >= 24
    else:
        assert "STAND-IN" not in said
    if OF[name].case == "kharaz-2001-from-15-deg":
        assert "(digitised)" in said
        assert "contradict" in said
    if OF[name].case == "cornell-glass":
        assert "(measured)" in said
        assert "FR, the authors' chart" in said
        assert "contradict" not in said
    if OF[name].kind == "theory":
        assert "theory alone, no data" in said


def test_fig_9_names_its_values_of_e_t_as_a_choice(picture):
    said = "\n".join(texts_of(picture("9").figure))
    assert said.count("our choice of value") == 3
    assert "FR: $e_t$ −1" in said


def test_fig_5_does_not_pretend_to_show_yu_and_tafti():
    assert "left out" in OF["5"].note
    (ours,) = [model for model in OF["5"].models if "elastic-plastic" in model.label]
    assert "ours, not Yu & Tafti's" in ours.label
    assert all("Yu" not in model.label for model in OF["5"].models if model is not ours)


@pytest.mark.parametrize(("by", "same"), [(1e-15, True), (1e-3, False)])
def test_the_last_bits_of_a_layout_are_not_in_the_svg(tmp_path, by, same):
    """Control: a shift that can be seen is."""
    first, second = draw_springs(), draw_springs()
    axes = second.axes[0]
    x, y, width, height = axes.get_position(original=True).bounds
    axes.set_position((x, y * (1.0 + by), width, height))
    bounds = [figure.axes[0].get_window_extent().bounds for figure in (first, second)]
    assert bounds[0] != bounds[1]
    save_figure(first, tmp_path / "a.svg")
    save_figure(second, tmp_path / "b.svg")
    assert ((tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()) is same
