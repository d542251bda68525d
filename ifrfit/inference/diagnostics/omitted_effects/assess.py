"""The effects of one fit: their criteria on the scene of the data, and what the residuals call for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ifrfit.inference.diagnostics.causes import slips_first
from ifrfit.inference.diagnostics.omitted_effects.dimensionless_criteria import effect_lines
from ifrfit.inference.diagnostics.omitted_effects.experimental_conditions import Setting
from ifrfit.inference.diagnostics.omitted_effects.selection import effect_scores, effects_fact
from ifrfit.inference.diagnostics.omitted_effects.types import EffectLine
from ifrfit.inference.diagnostics.series_compared import pooling
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Constants, Fact, by_entry
from ifrfit.physics.compliance.law import chi_range


def criteria_of(
    problem: Problem, fit: LeastSquaresFit, setting: Setting | None, derived: Mapping[str, Any]
) -> tuple[EffectLine, ...]:
    """The criterion of each effect on the scene of the data; empty where nothing is known of it.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    setting : Setting or None
        The scene of the data.
    derived : mapping
        Name to `Estimate`, or to one a series.
    """
    if setting is None:
        return ()
    return effect_lines(problem, fit, setting, kappa_known=_has_value("kappa", derived))


def causes_of(
    problem: Problem, fit: LeastSquaresFit, setting: Setting | None, constants: Constants
) -> dict[str, Fact]:
    """What the residuals call for.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    setting : Setting or None
        The scene of the data.
    constants : mapping
        Name to `Estimate`, or to one a series.

    Returns
    -------
    dict
        ``pooling`` of several series, ``slips``, and ``effects`` where one could show in these rows; of these
        what nothing before them explains.
    """
    chi, speed = None, 0.0
    if setting is not None:
        chi = _chi(setting, problem.inertia_factor)
        speed = setting.speed[0] if len(setting.speed) == 1 else 0.0
    found = effect_scores(problem, fit, chi=chi, speed=speed, e_n_known=_has_value("e_n", constants))
    return slips_first(problem, fit, found, effects_fact(problem, found), pooling(problem, fit))


def _chi(setting: Setting, j: float) -> float | None:
    """Compliance number of the materials, where it is one that like materials can have."""
    if setting.contact.stiffness_ratio is None:
        return None
    chi = 0.5 * setting.contact.stiffness_ratio * (1.0 + 1.0 / j)
    low, high = chi_range(j)
    return chi if low <= chi <= high else None


def _has_value(name: str, found: Mapping[str, Any]) -> bool:
    return all(one.value is not None for one in by_entry({name: found[name]}).values())
