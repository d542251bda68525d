"""What decides the answer although nobody said so: noise, independence, angles without offset, one plane."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ifrfit.inference.diagnostics.slips.nuisances import GRAVITY, Flaw, readings, zero_of_velocities
from ifrfit.inference.model.entry_names import entry_name
from ifrfit.inference.model.noise import normalised
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.angle_offset import slope_by_offset
from ifrfit.inference.optimize.laplace import first_order_move, kappa_coordinates
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Constants, Estimate, NoiseSummary, by_entry
from ifrfit.physics.angles import Incidence
from ifrfit.text import joined

# from changes of the values to the constant that moves most, in words, and by how many sd
Moved = Callable[[Array], tuple[str, float]]

_SPIN_ZERO = 0.02  # R omega_y/u before impact by which spins may be off, as an example
_SPINLESS = "no spin before impact"  # as a fit takes it of tables without one
_SPIN = 0.1  # R omega_y/u before impact, as an example of what such a table does not tell
_SPIN_STEP = 1e-4
_LATERAL = 0.1  # R omega_x/u before impact, as an example of what a camera from the side does not see
_MATTERS = 0.5  # sd of a constant from which rounding of the angles is told
_NOTHING = 1e-3  # sd of a constant by which it is moved in no sense
_ROUNDED = (2, 5, 10)  # degrees that angles are rounded to
_FEWEST_ANGLES = 4  # that are multiples of these by no chance

_OF_NOISE = {
    "known": "",
    "scaled": "errors as large as the scatter, in the proportions of sigma",
    "unknown": "errors as large as the scatter",
    "mixed": "errors of {estimated} as large as the scatter, those of {given} as given",
}
_INDEPENDENT = "errors independent of one another"
_COMPONENTS = ("v_x", "v_y", "v_n")
_AT_THE_WALL = "velocities those at the wall, to one scale along and across it"
_TILT = 5.0  # degrees by which a camera may look past the plane of motion, as an example
_DRIFT = 0.01  # m/s by which the wall or the tracking may move, as an example
_BETWEEN = 0.005  # s between reading and impact, as an example
COMPLETE = "no reading left out or picked for its value"


def assumed_of(
    problem: Problem,
    fit: LeastSquaresFit,
    constants: Constants,
    kappas: Mapping[str, Estimate],
    noise: NoiseSummary,
) -> tuple[str, ...]:
    """What a fit takes for granted, in words.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    constants, kappas : mapping
        Estimates: constants by name, kappa by series.
    noise : NoiseSummary
    """

    def moved(change: Array) -> tuple[str, float]:
        return _largest_move(moved_by(problem, fit, change), constants, kappas)

    offset = _offset_words(problem, fit, moved)
    plane = _plane_words(problem, fit, moved)
    words = _OF_NOISE[noise.policy]
    if noise.policy == "mixed":
        words = words.format(estimated=noise.whose(given=False), given=noise.whose(given=True))
    of_errors = _INDEPENDENT + _of_repeats(problem)
    if fit.common is not None:
        count = fit.common.value.size
        of_errors = f"{of_errors}, but for {count} that rows have in common"
    at_wall = _camera_words(problem, fit, moved)
    elsewhere = _restitution_words(problem)
    zero = _spin_zero_words(problem, fit, moved)
    every = (
        plane,
        at_wall,
        *_drift_words(problem, fit, moved),
        elsewhere,
        _scale_words(problem),
        words,
        _count_words(problem),
        of_errors,
        COMPLETE,
        offset,
        zero,
    )
    return tuple(said for said in every if said)


def with_size_of_spin(
    assumed: tuple[str, ...],
    problem: Problem,
    fit: LeastSquaresFit,
    constants: Constants,
    kappas: Mapping[str, Estimate],
) -> tuple[str, ...]:
    """The same assumptions, with what a spin before impact would move where none is assumed.

    Parameters
    ----------
    assumed : tuple of str
    problem : Problem
    fit : LeastSquaresFit
    constants, kappas : mapping
        As `assumed_of` has them.
    """
    if not (problem.has_oblique and problem.error_model.is_plain):
        return assumed

    def sized(said: str) -> str:
        if not said.startswith(_SPINLESS):
            return said
        silent = [s.name for s in problem.observations.sources if "spin" not in s.headers]
        here = problem.observations.stored["source"].isin(silent).to_numpy()
        # by the slope: what larger steps change at small angles, the law's transition moves with
        slope = _by_spin(problem, fit.optimum.theta, (0.0, _SPIN_STEP)) / _SPIN_STEP
        change = np.where(here, _SPIN * slope, 0.0)
        most, _ = _largest_move(moved_by(problem, fit, change), constants, kappas)
        return f"{said} (R omega/u of {_SPIN:g} would move {most})" if most else said

    return tuple(sized(said) for said in assumed)


def _camera_words(problem: Problem, fit: LeastSquaresFit, moved: Moved) -> str:
    """That velocities are those at the wall, and what a camera that shortens those along it would move."""
    if not set(_COMPONENTS) & set(problem.rows.names):
        return ""
    theta = fit.optimum.theta
    shorter = Flaw(along=math.cos(math.radians(_TILT)) - 1.0)
    # values read so, taken as they stand
    most, share = moved(problem.predict(theta) - readings(problem, theta, shorter))
    if share <= _MATTERS:
        return _AT_THE_WALL
    return (
        f"{_AT_THE_WALL} (a camera that looks {_TILT:g} degrees past the plane of motion would move {most})"
    )


def _drift_words(problem: Problem, fit: LeastSquaresFit, moved: Moved) -> list[str]:
    """That neither wall nor tracking moves and no time passes at the wall, where a little of it matters.

    Of ratios in a dataset its source tells how they were measured.
    """
    speed, sources = problem.speeds, problem.observations.sources
    said = set(_COMPONENTS) & set(problem.rows.names) or any(one.descriptor is None for one in sources)
    if not said or not (speed > 0.0).all():
        return []
    theta = fit.optimum.theta

    def matter(*zeros: tuple[str, str, float]) -> str:
        found = []
        for where, name, size in zeros:
            off = zero_of_velocities(name, size / speed)
            most, share = moved(problem.predict(theta) - readings(problem, theta, off))
            found.append((share, f"{where} would move {most}"))
        return "; ".join(says for share, says in sorted(found, reverse=True) if share > _MATTERS)

    at_rest = matter(
        *((f"{_DRIFT:g} m/s {way} the wall", f"zero-{way}", _DRIFT) for way in ("along", "across"))
    )
    between = f"gravity for {1000.0 * _BETWEEN:g} ms on either side"
    at_impact = matter((f"on a floor, {between}", "fall-between", GRAVITY * _BETWEEN))
    examples = {"wall and tracking at rest": at_rest, "speeds those at impact": at_impact}
    return [f"{what} ({example})" for what, example in examples.items() if example]


def _count_words(problem: Problem) -> str:
    """What numbers of readings behind a row, which a user gives, are not used for."""
    table, stated = problem.observations.table, problem.observations.sources
    if not any(source.descriptor is None for source in stated) or not (table["n_repeats"] > 1).any():
        return ""
    if problem.noise.has_unknown:
        return (
            "as much weight for each row whatever its n (else a sigma in every row, as s over the root of n)"
        )
    return "sigma that of the mean of the n readings of a row, not of one of them"


def _scale_words(problem: Problem) -> str:
    """That values are as read, where the largest of a series is 1 in every decimal."""
    rows = problem.rows
    own = [rows.names[rows.which[at[0]]] for at in problem.groups().values() if normalised(rows.value[at])]
    named = joined(list(dict.fromkeys(own)))
    return f"{named} as read, not divided by the largest, which is 1 exactly" if own else ""


def _restitution_words(problem: Problem) -> str:
    """That e_n was read at other angles than those for which it is taken, where the two do not meet."""
    gamma, rows = problem.rows.gamma_deg, problem.rows
    read, used = gamma[rows.of_kind("normal")], gamma[rows.is_oblique]
    read, used = read[np.isfinite(read)], used[np.isfinite(used)]
    if not read.size or not used.size or (read.max() >= used.min() and read.min() <= used.max()):
        return ""
    at = f"{read.min():.3g}" if np.ptp(read) == 0.0 else f"{read.min():.3g} to {read.max():.3g}"
    return f"e_n as read at {at} degrees, for impacts at {used.min():.3g} to {used.max():.3g}"


def _of_repeats(problem: Problem) -> str:
    """That repeats share no error, where most angles are repeated."""
    oblique = np.flatnonzero(problem.rows.is_oblique)
    settings = np.unique(problem.rows.repeated[oblique]).size
    # its angle as well: with --angle-errors each row has an error of its own
    return ", also those of repeats at one angle" if oblique.size >= 2 * settings > 0 else ""


def _offset_words(problem: Problem, fit: LeastSquaresFit, moved: Moved) -> str:
    """How far an offset of the set angles would move the constant that it moves most, in its sd."""
    model = problem.error_model
    if not problem.rows.has_angle.any() or fit.angle_offset is not None or model.angles != "none":
        return ""
    slope, step = slope_by_offset(problem, fit.optimum.theta), _step_of_angles(problem)
    if step:
        most, share = moved(0.5 * step * slope)
        if share > _MATTERS:
            return (
                f"angles of incidence, all multiples of {step:g} degrees, exact (rounded down they would be "
                f"{0.5 * step:g} too small on average, which would move {most})"
            )
    most, _ = moved(slope)
    return f"angles of incidence without an offset (1 degree would move {most})" if most else ""


def _step_of_angles(problem: Problem) -> int:
    """Whole degrees that all angles are multiples of, where they may have been rounded; else 0.

    Evenly spaced angles with as many impacts each were set.
    """
    of_impact = dict(zip(problem.rows.impacts.tolist(), problem.rows.gamma_deg.tolist(), strict=True))
    angles, count = np.unique([x for x in of_impact.values() if np.isfinite(x)], return_counts=True)
    if angles.size < _FEWEST_ANGLES or (angles != np.round(angles)).any():
        return 0
    step = int(np.gcd.reduce(angles.astype(int)))
    were_set = np.ptp(count) == 0 and np.ptp(np.diff(angles)) == 0.0
    return 0 if were_set or step not in _ROUNDED else step


def _plane_words(problem: Problem, fit: LeastSquaresFit, moved: Moved) -> str:
    """That the one component of spin that is given is all there is, and what another would move."""
    sources = [s for s in problem.observations.sources if s.descriptor is None and s.rows_used > 0]
    planar = [s.name for s in sources if "spin" in s.headers and "lateral_spin" not in s.headers]
    i = problem.rows.incidence
    if not planar or not problem.has_oblique or i.spin_x.any():
        return ""
    where = "" if len(planar) == len(problem.observations.sources) else f" in {joined(planar)}"
    said = f"motion in one plane, no lateral spin before impact{where}"
    if not problem.error_model.is_plain:
        return said
    most, _ = moved(_by_spin(problem, fit.optimum.theta, (_LATERAL, 0.0)))
    return f"{said} (R omega_x/u of {_LATERAL:g} would move {most})" if most else said


def _spin_zero_words(problem: Problem, fit: LeastSquaresFit, moved: Moved) -> str:
    """How far a zero of the given spins that is off would move the constant that it moves most, in its sd."""
    if not (problem.rows.incidence.spin_y.any() and problem.has_oblique and problem.error_model.is_plain):
        return ""
    most, _ = moved(_by_spin(problem, fit.optimum.theta, (0.0, _SPIN_ZERO)))
    said = "spins before impact without an offset"
    return f"{said} (R omega_y/u of {_SPIN_ZERO:g} would move {most})" if most else said


def _by_spin(problem: Problem, theta: Array, more: tuple[float, float]) -> Array:
    """By how much every row's value is larger, (n,), where every impact has more spin, (x, y)."""
    rows, i = problem.rows, problem.rows.incidence
    spinning = Incidence.of(rows.gamma_deg, i.spin_x + more[0], i.spin_y + more[1], degrees=True)
    other = replace(problem, rows=replace(rows, incidence=spinning, tau=spinning.tau))
    return other.predict(theta) - problem.predict(theta)


def _largest_move(
    moves: Mapping[str, float], constants: Constants, kappas: Mapping[str, Estimate]
) -> tuple[str, float]:
    """The constant that moves most in its sd, by how much; empty and 0 where there is none."""
    alone = len(kappas) == 1
    of_kappa = {entry_name("kappa", "" if alone else name): each for name, each in kappas.items()}
    # kappa speaks where the data leave mu open
    share = _share(moves, by_entry(constants)) or _share(moves, of_kappa)
    name = max(share, key=lambda one: share[one], default="")
    if share.get(name, 0.0) < _NOTHING:
        return "", 0.0
    return f"{name} by {abs(moves[name]):.2g}, {share[name]:.2g} sd", share[name]


def _share(moves: Mapping[str, float], found: Mapping[str, Estimate]) -> dict[str, float]:
    """Moves over the sd of what has a value."""
    known = {name: each.stderr for name, each in found.items() if name in moves and each.value is not None}
    return {name: abs(moves[name]) / sd for name, sd in known.items() if sd}


def moved_by(problem: Problem, fit: LeastSquaresFit, change: Array) -> dict[str, float]:
    """By how much the optimum moves where every row's value is larger by a change, (n,), to first order.

    Returns
    -------
    dict
        By the names of theta, and kappa by that of its place in the expansion.
    """
    theta = fit.optimum.theta
    common = None if fit.common is None else fit.common.loadings
    moved, _ = first_order_move(problem, fit.sigma, theta, change, common)
    names, _, to_theta = kappa_coordinates(problem, theta)
    in_theta = to_theta @ moved
    by_name = dict(zip(names, moved.tolist(), strict=True))
    return by_name | dict(zip(problem.parameters.names, in_theta.tolist(), strict=True))
