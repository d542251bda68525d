"""`measure_costs`: what accuracy costs in time, on the user's own data and machine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Unpack

from ifrfit.cost.arithmetic_costs import arithmetic_costs
from ifrfit.cost.conditions import beginning, setting_of
from ifrfit.cost.inference_costs import FULL, QUICK, Reference, inference_costs
from ifrfit.cost.physics_costs import physics_costs, scaling_doubt
from ifrfit.cost.result import Costs
from ifrfit.cost.timing import KINDS, Cost, Kind
from ifrfit.errors import UsageError
from ifrfit.inference.fit import Data, make_question
from ifrfit.inference.keywords import FitKeywords, check_keywords, model_of, noise_of
from ifrfit.inference.options import Model, Noise
from ifrfit.text import power_of_ten


def measure_costs(
    data: Data | Sequence[Data],
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
    data : str, Path, Observations, or a sequence of them
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
    """
    check_keywords("measure_costs", FitKeywords, keywords)
    requested = _kinds(kinds)
    chosen = model_of(model, keywords)
    question = make_question(data, chosen, noise_of(noise), seed, scene, keywords)
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
        measured = inference_costs(
            found.problem_and_optimum()[0], extent=extent, seed=seed, progress=progress
        )
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
