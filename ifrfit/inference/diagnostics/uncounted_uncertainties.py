"""Uncertainties of angles and spins that the table states and the fit does not count."""

from __future__ import annotations

from ifrfit.inference.model.problem import Problem
from ifrfit.text import joined


def uncounted_uncertainties(problem: Problem) -> tuple[str, ...]:
    """Columns of uncertainties of angles and spins that are taken as exact, as the user called them."""
    if problem.error_model.angles != "none":
        return ()
    columns = ("sigma_spin_x", "sigma_spin_y", "sigma_gamma_deg")
    stated = [column for column in columns if (getattr(problem.rows, column) > 0.0).any()]
    return tuple(problem.observations.called(column) for column in stated)


def remedy_of_uncounted(problem: Problem) -> str:
    """What counts them, to follow on what a misfit says; empty where there are none, or nothing can."""
    columns = uncounted_uncertainties(problem)
    possible = problem.closure.bilinear and problem.error_model.is_plain and problem.noise.is_given.all()
    if not columns or not possible:
        return ""
    verb = "is" if len(columns) == 1 else "are"
    them = "it" if len(columns) == 1 else "them"
    return f"; {joined(columns)} {verb} not counted: try --angle-errors effective first, which counts {them}"
