"""Scenes and pictures of the paper's figures, made once."""

from __future__ import annotations

import functools
from collections.abc import Callable

import pytest

from ifrfit.paper.figures import FIGURES, PaperFigure
from ifrfit.paper.reproduce import make_figure, scene_of


def named(name: str) -> PaperFigure:
    return next(figure for figure in FIGURES if figure.name == name)


@pytest.fixture(scope="session", autouse=True)
def nothing_installed(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("IFRFIT_DATA_DIR", str(tmp_path_factory.mktemp("data")))
        yield


@pytest.fixture(scope="session")
def fits() -> dict:
    """Fits by case, shared by all figures."""
    return {}


@pytest.fixture(scope="session")
def scene(nothing_installed, fits) -> Callable:
    """Scene of a figure by its name."""
    return functools.cache(lambda name: scene_of(named(name), fits))


@pytest.fixture(scope="session")
def picture(nothing_installed, fits) -> Callable:
    """Figure and rows by the figure's name, for the whole run of `reproduce` as well."""
    return functools.cache(lambda name: make_figure(named(name), fits))
