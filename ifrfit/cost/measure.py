"""`measure_costs`: what accuracy costs in time, on the user's own data and machine."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ifrfit.cost.conditions import Setting, setting_of
from ifrfit.cost.inference_costs import FULL, QUICK, Reference, inference_costs
from ifrfit.cost.result import Costs
from ifrfit.cost.starting_optimum import beginning
from ifrfit.cost.timing import KINDS, Cost, Kind
from ifrfit.data import Observations
from ifrfit.errors import UsageError
from ifrfit.text import power_of_ten


def measure_costs(
    data: str | Path | Observations | Sequence[str | Path | Observations],
    *,
    kinds: str | Sequence[str] = KINDS,
    quick: bool = False,
    seed: int = 0,
    command: str = "",
    progress: Callable[[int, int], None] | None = None,
    **choices: Any,
) -> Costs:
    """Measure times and errors, here and now.

    Parameters
    ----------
    data : str, Path, Observations, or a sequence of them
        As in `ifrfit.fit`.
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
    **choices
        Keywords of `ifrfit.fit` that choose data, closure, constants, noise and scatter. Methods that do not
        know the scatter are left out, which the notes say.

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
    wanted = _kinds(kinds)
    found = beginning(data, posterior="inference" in wanted, seed=seed, command=command, **choices)
    costs: list[Cost] = []
    about: dict[str, str] = {}
    notes: list[str] = []
    reference: Reference | None = None
    others = [kind for kind in wanted if kind != "inference"]
    # before anything is measured: it may refuse
    setting = setting_of(found, data, choices) if others else None
    if "inference" in wanted:
        extent = QUICK if quick else FULL
        measured = inference_costs(found.problem, extent=extent, seed=seed, progress=progress)
        costs += measured.costs
        reference = measured.reference
        notes += measured.notes
    if setting is not None:
        for kind in others:
            costs += _OTHERS[kind](setting, quick)
            about[kind] = setting.words(kind)
        notes += setting.notes
        if "physics" in wanted and setting.constants["e_n"] < 1.0:
            notes.append(_doubt(setting))
    return Costs(tuple(costs), found, reference, about, tuple(notes))


def _kinds(given: str | Sequence[str]) -> tuple[Kind, ...]:
    names = (given,) if isinstance(given, str) else tuple(given)
    for name in names:
        if name not in KINDS:
            raise UsageError(f"--kind {name}: choose {', '.join(KINDS[:-1])} or {KINDS[-1]}.")
    return tuple(kind for kind in KINDS if kind in names) or KINDS


def _physics(setting: Setting, quick: bool) -> list[Cost]:
    from ifrfit.cost.physics_costs import physics_costs

    own = setting.constants
    return physics_costs(
        gamma_deg=setting.grid(),
        spin_y=setting.spin,
        e_n=own["e_n"],
        mu=own["mu"],
        chi=own["chi"],
        given={"ifr": own["e_t"]},
        quick=quick,
    )


def _doubt(setting: Setting) -> str:
    """What no error of physics holds."""
    from ifrfit.cost.physics_costs import scaling_doubt

    own = setting.constants
    doubt = scaling_doubt(
        gamma_deg=setting.grid(), spin_y=setting.spin, e_n=own["e_n"], mu=own["mu"], chi=own["chi"]
    )
    return (
        "The converged solution is elastic, scaled to e_n < 1. Another rule moves beta by up to "
        f"{power_of_ten(doubt)} (Stronge's model, scaled and as it is), which is in none of the errors of "
        "physics."
    )


def _arithmetic(setting: Setting, quick: bool) -> list[Cost]:
    from ifrfit.cost.arithmetic_costs import arithmetic_costs

    own = setting.constants
    return arithmetic_costs(
        gamma_deg=setting.gamma,
        spin_y=setting.spin_y,
        e_n=own["e_n"],
        e_t=own["e_t"],
        mu=own["mu"],
        quick=quick,
    )


_OTHERS: Mapping[Kind, Callable[[Setting, bool], list[Cost]]] = {
    "physics": _physics,
    "arithmetic": _arithmetic,
}
