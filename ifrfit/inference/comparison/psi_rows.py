"""LinearRows restated in the psi plane, as residuals that are linear in its two slopes and one intercept.

In the plane Psi_1 = U_t/U_n = tau and Psi_2 = V_t/U_n, sticking is a line through the origin and sliding a
line with an intercept: Psi_2 = (S - D) tau where impacts stick, Psi_2 = S tau - I where they slide, and they
stick where D tau <= I. Since Psi_2 = (1 - (1 + J)/J k) tau, every observable that is linear in the impulse
factor k says the same as a point of the plane, with its own error bar.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.piecewise import LinearRows, PiecewiseProblem
from ifrfit.physics.closure import rotational_share
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SLIDING, DIFFERENCE, INTERCEPT = 0, 1, 2  # places of S, D and I in t
STEEPEST = 10.0  # size of a slope beyond which nothing is looked for


@dataclass(frozen=True)
class PsiRows:
    """LinearRows of the plane.

    Attributes
    ----------
    tau : ndarray, (n,)
    value : ndarray, (n,)
        Observation less what the observable is without slip after.
    weight_of_psi : ndarray, (n,)
        Derivative of the observation by Psi_2/tau.
    base : ndarray, (n,)
        Its uncertainty, up to the unknown noise: sigma as given, or 1.
    group : ndarray of int, (n,)
        Unknown noise of each row; -1 where sigma is given.
    """

    tau: Array
    value: Array
    weight_of_psi: Array
    base: Array
    group: Index

    def weighted(self, sigma: Array) -> PiecewiseProblem:
        """The sum of squares with these uncertainties, in t = (S, D, I)."""
        w, y = self.weight_of_psi / sigma, self.value / sigma
        zero = np.zeros_like(w)
        with np.errstate(divide="ignore"):
            inverse = np.where(np.isinf(self.tau), 0.0, 1.0 / self.tau)
        stick = np.column_stack((w, -w, zero))
        slide = np.column_stack((w, zero, -w * np.where(np.isfinite(inverse), inverse, 0.0)))
        still, grazing = self.tau <= 0.0, np.isinf(self.tau)
        always = np.concatenate((stick[still], slide[grazing]))
        inner = ~(still | grazing)
        reach = float(self.tau[inner].max(initial=1.0))
        constraints = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
        # wide enough for slopes of sticking as steep, and for all impacts to stick
        limits = STEEPEST * np.array([1.0, 1.0, 2.0, 0.0, 4.0 * reach, 0.0])
        return PiecewiseProblem(
            self.tau[inner],
            LinearRows.of(stick[inner], y[inner]),
            LinearRows.of(slide[inner], y[inner]),
            LinearRows.of(always, np.concatenate((y[still], y[grazing]))),
            np.array([0.0, 0.0, 1.0]),
            0.0,
            np.array([0.0, 1.0, 0.0]),
            0.0,
            constraints,
            limits,
        )


def psi_rows(problem: Problem) -> tuple[PsiRows | None, dict[str, str]]:
    """LinearRows that can be restated, and why the others cannot.

    Returns
    -------
    PsiRows or None
        None where there are none.
    mapping
        Observable to the reason.
    """
    e_n = problem.parameters["e_n"].fixed
    share = rotational_share(problem.inertia_factor)
    left_out: dict[str, str] = {}
    parts: list[tuple[Index, Array, Array]] = []
    for name in problem.rows.names:
        at = problem.rows.rows_of(name)
        reason = _reason(name, e_n)
        if reason:
            left_out[name] = reason
            continue
        observable = OBSERVABLES[name]
        assert observable.linear is not None
        scale = {"one": 1.0, "impulse": 1.0 / (1.0 + (e_n or 0.0)), "rebound": 1.0 / (e_n or 1.0)}
        part = problem.rows.take(at)
        offset, slope = (
            scale[observable.scale] * x for x in observable.linear(part.incidence, problem.inertia_factor)
        )
        # k = share (1 - Psi_2/tau)
        told = np.isfinite(offset) & np.isfinite(slope) & (slope != 0.0)
        if told.any():
            rest = part.value[told] - offset[told] - share * slope[told]
            parts.append((at[told], rest, -share * slope[told]))
    if not parts:
        return None, left_out
    rows, value, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    base = problem.noise.base[rows]
    return PsiRows(problem.rows.tau[rows], value, weight, base, problem.noise_numbers[rows]), left_out


def _reason(name: str, e_n: float | None) -> str:
    """Why an observable is no point of the plane; empty if it is one."""
    observable = OBSERVABLES[name]
    if observable.kind in ("normal", "friction"):
        return "holds no tangential velocity"
    if observable.kind == "curved":
        return "is not linear in the tangential impulse"
    if observable.scale != "one" and not e_n:
        return "holds e_n too: fix it"
    return ""
