"""`measure_costs`: what accuracy costs in time, on the user's own data and machine."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from ifrfit.cost.arithmetic_costs import arithmetic_costs
from ifrfit.cost.inference_costs import FULL, QUICK, Reference, inference_costs
from ifrfit.cost.physics_costs import physics_costs, scaling_doubt
from ifrfit.cost.result import Costs
from ifrfit.cost.timing import KINDS, Cost, Kind
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.estimations import least_squares_estimation
from ifrfit.inference.fit import Data, Question, make_question
from ifrfit.inference.keywords import FitKeywords, model_of, noise_of, split_columns
from ifrfit.inference.model.common_errors import refuse
from ifrfit.inference.notebook_progress import shown_in_notebook
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.options import Model, Noise
from ifrfit.inference.posterior.integral_layout import no_grid
from ifrfit.inference.result.build import build_result
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closures import get_closure
from ifrfit.text import power_of_ten

Array = NDArray[np.float64]

SOLID = 0.4  # inertia factor
_ANGLES = 181
_LEAST = 1e-3  # friction below which hardly anything sticks or slides by it


def beginning(
    question: Question, model: Model, *, posterior: bool = True, seed: int = 0, command: str = ""
) -> FitResult:
    """Least squares of the data; by effective variance where the true angles are to be integrated out.

    `ifrfit.fit` refuses least squares of such errors as an answer; as a place to begin they are good enough.

    Parameters
    ----------
    question : Question
    model : Model
    posterior : bool
        Whether errors are to be measured against an exact posterior of these data.
    seed, command
        As in `ifrfit.fit`.

    Raises
    ------
    UsageError
        As `ifrfit.fit`; for an angle offset; with `posterior` where the errors do not allow one.
    DataError
        As `ifrfit.fit`.
    """
    problem = question.problem(get_closure(model.closure), model.parameters(question.inertia_factor))
    if problem.common is not None:
        raise refuse("ifrfit cost")
    if problem.offset is not None:
        raise UsageError("ifrfit cost measures no fit of an angle offset: leave --angle-offset out.")
    reason = no_grid(problem) if posterior else ""
    if reason:
        about = reason.partition(". ")[0]
        raise UsageError(
            f"{about}, so there is no quadrature to measure errors against. Fix e_n, or choose "
            "--kind physics or arithmetic."
        )
    optimum = least_squares(problem)
    estimation = least_squares_estimation(optimum)
    conditions = question.conditions
    return build_result(problem, optimum, estimation, seed=seed, command=command, conditions=conditions)


@dataclass(frozen=True)
class Setting:
    """Where contact laws and precisions are measured.

    Attributes
    ----------
    gamma, spin_y : ndarray, (n,)
        Incidence angles in degrees, and spins, of the rows that have an angle.
    constants : mapping of str to float
        e_n, e_t, mu of closure IFR and chi of MAW.
    notes : tuple of str
        Where a constant is not the data's.
    """

    gamma: Array
    spin_y: Array
    constants: Mapping[str, float]
    notes: tuple[str, ...]

    def grid(self) -> Array:
        """Angles from the least to the largest of the data, degrees."""
        return np.linspace(self.gamma.min(), self.gamma.max(), _ANGLES)

    def contact(self) -> dict[str, Any]:
        """Arguments of `ifrfit.cost.physics_costs` for the angles of the data at their median spin."""
        own = {name: self.constants[name] for name in ("e_n", "mu", "chi")}
        return {"gamma_deg": self.grid(), "spin_y": self.spin, **own}

    @property
    def spin(self) -> float:
        """Median spin."""
        return float(np.median(self.spin_y))

    def words(self, kind: str) -> str:
        """What was asked, in a line."""
        own = self.constants
        at = f"e_n = {own['e_n']:.4g}, mu = {own['mu']:.4g}"
        if kind == "physics":
            at += f", chi = {own['chi']:.4g}, e_t = {own['e_t']:.4g}"
            spin = f", R omega_y/u = {self.spin:.4g}" if self.spin else ""
            return f"at {at}; {self.gamma.min():.3g} to {self.gamma.max():.3g} degrees{spin}"
        return f"at {at}, e_t = {own['e_t']:.4g}; the data's own impacts and hard ones"


def setting_of(found: FitResult, question: Question, model: Model) -> Setting:
    """Angles and spins of the data, and the constants that least squares finds in them.

    Parameters
    ----------
    found : FitResult
        A fit of the data by any closure.
    question : Question
    model : Model
        What it was made with.

    Raises
    ------
    UsageError
        If no row has an angle, or for another body than a solid sphere.
    """
    points = found.points
    points = points[points["gamma_deg"].notna()]
    if not len(points):
        raise UsageError(
            "No row has an incidence angle, at which contact laws could be measured: add --kind inference."
        )
    if found.inertia_factor != SOLID:
        raise UsageError(
            f"Contact laws and precisions are measured for a solid sphere, not for inertia factor "
            f"{found.inertia_factor:g}: add --kind inference."
        )
    # e_n and mu are those of IFR, so that its e_t goes with them
    constants = _optimum(found if found.closure == "ifr" else _fitted("ifr", question, model))
    notes: list[str] = []
    error_model = question.noise.error_model
    if error_model.integrates:
        notes.append(
            "The constants at which contact laws and precisions are measured are those of effective "
            "variance: least squares cannot integrate true angles out."
        )
    chi = _chi(found, question, model)
    if chi is not None and not error_model.is_plain:
        notes.append("chi is that of independent Gaussian errors: closure MAW knows no others.")
    if chi is None:
        chi = 0.5 * sum(get_closure("maw").domain(SOLID))
        notes.append(
            f"Closure MAW does not find chi in these data: the middle of its domain, {chi:.3g}, is taken."
        )
    if constants["mu"] < _LEAST:
        constants["mu"] = _LEAST
        notes.append(f"Contact laws need friction: mu = {_LEAST:g} is taken in the place of a smaller one.")
    gamma, spin_y = (points[name].to_numpy(dtype=float) for name in ("gamma_deg", "spin_y"))
    return Setting(gamma, spin_y, constants | {"chi": chi}, tuple(notes))


def _chi(found: FitResult, question: Question, model: Model) -> float | None:
    """Least squares of closure MAW, in the first series; None where the data do not tell it."""
    plain = replace(question, noise=question.noise.with_gaussian_values())
    try:
        own = found if found.closure == "maw" else _fitted("maw", plain, model)
    except (DataError, UsageError):
        return None
    estimate = next(each for name, each in own.flat_constants().items() if name.startswith("chi"))
    return estimate.value


def _fitted(name: str, question: Question, model: Model) -> FitResult:
    """Least squares of another closure, with what of the user's choices holds for it."""
    return beginning(question, model.with_closure(get_closure(name)), posterior=False)


def _optimum(found: FitResult) -> dict[str, float]:
    """Constants in the first series; where the data leave one open, at the end of its default prior."""
    problem, optimum = found.problem_and_optimum()
    entries, theta = problem.parameters.entries, optimum.optimum.theta
    places = problem.parameters.positions
    return {name: float(min(theta[at[0]], entries[at[0]].prior_upper)) for name, at in places.items()}


def measure_costs(
    data: Data | Sequence[Data] | None = None,
    model: Model | None = None,
    *,
    noise: str | Noise | None = None,
    kinds: str | Sequence[str] = KINDS,
    quick: bool = False,
    seed: int = 0,
    command: str = "",
    scene: str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
    **keywords: Unpack[FitKeywords],
) -> Costs:
    """Measure times and errors, here and now.

    Parameters
    ----------
    data : str, Path, table, Observations, or a sequence of them
        As in `ifrfit.fit`.
    model : Model, optional
        As in `ifrfit.fit`.
    noise : {"known", "scaled", "unknown", "mixed"} or Noise, optional
        As in `ifrfit.fit`. Methods that do not know the errors are left out, which the notes say.
    kinds : str or sequence of str
        inference: every method of `fit` on these data; physics: contact laws at the angles of the data;
        arithmetic: single and double precision against 50 digits.
    quick : bool
        Fewer settings and repeats.
    seed : int
        Of chains and replicates.
    command : str
        The command line, for the record.
    progress : callable, optional
        Called with the number of choices of inference measured and the most there may be.
    scene : str or Path, optional
        As in `ifrfit.fit`.
    **keywords
        Those of `ifrfit.fit` but for the options of methods.

    Returns
    -------
    Costs

    Raises
    ------
    UsageError
        For a kind that does not exist, data without an angle where physics or arithmetic was asked for, a
        problem without an exact posterior where inference was, and as `ifrfit.fit`.
    DataError
        As `ifrfit.fit`.

    Examples
    --------
    >>> import ifrfit
    >>> costs = ifrfit.measure_costs("cross-2019", fix={"e_n": 0.9}, kinds="arithmetic", quick=True)
    >>> costs.table()["method"].unique().tolist()
    ['float32', 'float64', '50 digits']
    """
    data, options = split_columns("measure_costs", FitKeywords, data, keywords)
    requested = _kinds(kinds)
    chosen = model_of(model, options)
    if chosen.tie:
        raise UsageError("Costs are those of all methods, and --tie is known to two of them: leave it out.")
    question = make_question(data, chosen, noise_of(noise), seed, scene, options)
    found = beginning(question, chosen, posterior="inference" in requested, seed=seed, command=command)
    costs: list[Cost] = []
    about: dict[str, str] = {}
    notes: list[str] = []
    reference: Reference | None = None
    others = [kind for kind in requested if kind != "inference"]
    # before anything is measured: it may refuse
    setting = setting_of(found, question, chosen) if others else None
    if "inference" in requested:
        extent = QUICK if quick else FULL
        problem, _ = found.problem_and_optimum()
        with shown_in_notebook(progress, "measuring", "choices") as seen:
            measured = inference_costs(problem, extent=extent, seed=seed, progress=seen)
        costs += measured.costs
        reference = measured.reference
        notes += measured.notes
    if setting is not None:
        if "physics" in requested:
            given = {"ifr": setting.constants["e_t"]}
            costs += physics_costs(**setting.contact(), given=given, quick=quick)
        if "arithmetic" in requested:
            own = {name: setting.constants[name] for name in ("e_n", "e_t", "mu")}
            costs += arithmetic_costs(gamma_deg=setting.gamma, spin_y=setting.spin_y, **own, quick=quick)
        about = {kind: setting.words(kind) for kind in others}
        notes += setting.notes
        if "physics" in requested and setting.constants["e_n"] < 1.0:
            doubt = power_of_ten(scaling_doubt(**setting.contact()))
            notes.append(
                "The converged solution is elastic, scaled to e_n < 1. Another rule moves beta by up to "
                f"{doubt} (Stronge's model, scaled and as it is), which is in none of the errors of physics."
            )
    return Costs(tuple(costs), found, reference, about, tuple(notes))


def _kinds(given: str | Sequence[str]) -> tuple[Kind, ...]:
    names = (given,) if isinstance(given, str) else tuple(given)
    for name in names:
        if name not in KINDS:
            raise UsageError(f"--kind {name}: choose {', '.join(KINDS[:-1])} or {KINDS[-1]}.")
    return tuple(kind for kind in KINDS if kind in names) or KINDS
