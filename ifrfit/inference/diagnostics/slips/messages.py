"""What is said of a slip: what it is, how large, and the option or the edit that tries it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ifrfit.inference.diagnostics.omitted_effects.score_tests import short_words
from ifrfit.inference.diagnostics.residuals import exclude_names
from ifrfit.inference.diagnostics.slips.alternatives import SPIN_UNITS
from ifrfit.inference.diagnostics.slips.compared_fit import Slip
from ifrfit.inference.diagnostics.slips.nuisances import GRAVITY
from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.physics.inertia import BODIES
from ifrfit.text import joined, p_text, plus_minus

_MOST_LINES = 12  # of a table with two kinds of reading
_MUCH = 0.1  # share of the speeds beyond which their scale is seldom off
_MOST_SERIES = 6  # that are named
_LONGEST = 4  # rows that are named
_OF_ANGLES = ("angle-scale", "rebound-scale", "angles-scale")
_OF_LENGTHS = ("speed-scale", "contact-scale", "scale-along-wall", "spin-scale")
_SCALES = (*_OF_ANGLES, *_OF_LENGTHS)
# of what is looked for, for the sentence that nothing was found
_KINDS = {
    "angles": ("angle-offset", "rebound-zero", *_OF_ANGLES, "camera-turn"),
    "scales": _OF_LENGTHS,
    "height above the wall": ("height", "fall"),
    "zero of the velocities": ("zero-along", "zero-across"),
    "inertia factor": ("inertia-factor",),
    "spin before": ("incoming-spin", "incoming-roll", "spin-zero"),
    "drifts along the table": ("restitution-drift", "friction-drift", "sticking-drift"),
}
_NEAR = 0.02  # of an inertia factor, from that of a known body
# small flaws of the measurement
FLAWS = ("angle-offset", "rebound-zero", "camera-turn", *_SCALES)
# what is off, and what to do
_SIZED = {
    "angle-offset": (
        "angles of incidence off by {opposite} degrees",
        "check the zero of the angle, or let it be fitted with --angle-offset {prior:.1f}",
    ),
    "rebound-zero": (
        "angles of rebound off by {size} degrees",
        "check the zero of the angle; take {slip.size:.2g} degrees off delta_deg",
    ),
    "angle-scale": (
        "angles of incidence {percent} off in scale",
        "check the scale of the angle",
    ),
    "rebound-scale": (
        "angles of rebound {percent} off in scale",
        "check the scale of the angle",
    ),
    "angles-scale": (
        "angles of incidence and of rebound {percent} off in scale",
        "check the scale of the angles",
    ),
    "camera-turn": (
        "a camera turned against the wall by {size} degrees",
        "take {slip.size:.2g} degrees off the directions before impact, add them to those after",
    ),
    "speed-scale": (
        "speeds after impact {percent} off beside those before",
        "check scale and times of the camera",
    ),
    "contact-scale": (
        "velocities of the contact point after impact {percent} off beside those before",
        "check scale and times of the camera",
    ),
    "scale-along-wall": (
        "lengths along the wall {percent} off beside those across it",
        "check that pixels are squares and that the camera looks along the wall",
    ),
    "divided-by-largest": (
        "values whose largest is 1 exactly, {percent} too large, as where they were divided by it",
        "give them as they were read",
    ),
    "spin-scale": ("spins {percent} off beside the speeds", "check the radius and the scale"),
    "incoming-spin": (
        "spin before impact that is not in it, R omega_y/u of some {size}",
        "measure it; a column spin_y holds it",
    ),
    "incoming-roll": (
        "spin before impact that is not in it, some {size} of pure rolling",
        "measure it; a column spin_y holds R omega_y/u, negative in rolling",
    ),
    "spin-zero": (
        "spins before impact whose zero is off, R omega_y/u larger by {size} than the table has it",
        "check their zero; add {slip.size:.2g} to the column spin_y",
    ),
    "zero-along": (
        "velocities along the wall before impact and after {most} m/s too {large} (positive as the ball "
        "comes)",
        "does the wall move, or the tracking drift? To try it, {mend} them",
    ),
    "zero-across": (
        "velocities across the wall before impact and after {most} m/s too {large} (positive into the wall)",
        "does the wall move, or the tracking drift? To try it, {mend} them",
    ),
    "zero-along-after": (
        "velocities along the wall after impact {most} m/s too {large} (positive as the ball comes)",
        "check their zero; {mend} them",
    ),
    "zero-across-after": (
        "velocities away from the wall after impact {most} m/s too {large}",
        "check their zero; {mend} them",
    ),
    "fall-between": (
        "speeds across the wall before impact and after {size} m/s too small, as where gravity acts for "
        "{time:.2g} ms between reading and impact",
        "carry the tracks on to the wall",
    ),
}
_SIZED |= {
    f"{kind}{when}": (
        f"velocities {f'{when[1:]} impact ' if when else ''}as they were above the wall, {height}, where "
        "gravity changes them",
        "carry the tracks on to the wall",
    )
    for kind, height in (("height", "by {size} m"), ("fall", "by 2 g h/u^2 of {size}"))
    for when in ("", "-before", "-after")
}
_DRIFT = (
    "a drift of {slip.constant} along it, from {first:.3g} to {last:.3g} (by {size})",
    "look for wear, dirt or temperature; name days, runs or parts in a column series, and give each its "
    "own with --separate {slip.constant}",
)
# what is divided by a scale to try it
_SCALED = {
    "angle-scale": "the angles of incidence",
    "rebound-scale": "those of rebound",
    "angles-scale": "both",
    "speed-scale": "velocities after",
    "contact-scale": "those of the contact point after, as beta is,",
    "scale-along-wall": "those along it, before and after,",
    "spin-scale": "the spins",
}
_UNSIZED = {
    "angle-in-radians": (
        "angles of incidence in radians, which were read as degrees",
        "--convention angle=rad",
    ),
    "angle-in-gon": (
        "angles of incidence in gon (400 a circle), which were read as degrees",
        "multiply them by 0.9",
    ),
    "angles-in-gon": (
        "angles of incidence and {0} in gon (400 a circle), which were read as degrees",
        "multiply all of them by 0.9",
    ),
    "angles-from-wall": (
        "angles of incidence and {0} from the wall, which were read as those from the normal",
        "--convention angle=from-wall, and 90 degrees less {0} in its column",
    ),
    "from-wall": (
        "{0} from the wall, which was read as that from the normal",
        "take 90 degrees less {0}",
    ),
    "size": (
        "{0} without its sign",
        "give the readings their signs: one that is turned back has another",
    ),
    "sign": ("the opposite sign in {0}", "turn the sign round"),
    "exchanged": ("{0} in each other's columns", "exchange the headers"),
    "sorted": (
        "{0} sorted by itself, not along with the angles",
        "give each value beside the angle that it was read at",
    ),
    "squared": ("{0} as a ratio of energies or heights", "take the square root of {0}"),
    "percent": ("{0} in percent", "divide {0} by 100"),
    "radians": ("{0} in radians", "call the column {1}_rad"),
    "meant-beta_cm": ("beta_cm in the column of {0}", "--convention beta=centre"),
}
_MEANT = ("{2} in the column of {0}", "--convention column:{2}={0}")
_MIXED = {
    "mixed-sign": ("of the opposite sign", "turn the sign round in these lines"),
    "mixed-sign-below-zero": (
        "of the opposite sign",
        "look at the signs of these lines, and of all that were written down with them (where the value is "
        "near 0 a wrong sign does not show), and turn those that are wrong; readings below 0 that noise made "
        "stay",
    ),
    "mixed-squared": (
        "as a ratio of energies or heights",
        "take the square root of the values of these lines",
    ),
    "mixed-percent": ("in percent", "divide the values of these lines by 100"),
    "mixed-angle-from-wall": (
        "angles from the wall beside angles from the normal",
        "take 90 degrees less the angle there",
    ),
    "mixed-angle-in-radians": (
        "angles of incidence in radians",
        "multiply the angles of these lines by 180/pi",
    ),
}
_SPIN_WORDS = {
    "spins-doubled": (
        "twice as large as they are (a diameter for the radius?)",
        "divide the spins by 2",
    ),
    "spins-halved": (
        "half as large as they are (half a radius for the radius?)",
        "multiply the spins by 2",
    ),
    "spins-in-hertz": (
        "in revolutions, which were read as radians",
        "multiply the spins by 2 pi",
    ),
    "spins-in-rpm": (
        "in revolutions per minute, which were read as radians per second",
        "multiply the spins by 2 pi/60",
    ),
    "spins-read-as-hertz": (
        "in radians, which were read as revolutions",
        "divide the spins by 2 pi",
    ),
    "spins-read-as-rpm": (
        "in radians per second, which were read as revolutions per minute",
        "multiply the spins by 60/(2 pi)",
    ),
}


def none_words(tested: Sequence[Slip]) -> str:
    """What was looked for in vain."""
    sized = {slip.name: slip.p for slip in tested if slip.sd}
    kinds = [kind for kind, names in _KINDS.items() if any(name in sized for name in names)]
    looked = joined([*kinds, "signs", "units"])
    least = min(sized.values(), default=1.0)
    if least < REFUTED:
        return f"no slip in the table explains as much as an effect does ({looked} looked at)"
    return f"no slip shows in the table ({looked} looked at{f'; p = {p_text(least)}' if sized else ''})"


def slip_words(
    problem: Problem,
    named: Sequence[Slip],
    effects: Sequence[str],
    series: str = "",
    left: float = 1.0,
    closures: Sequence[str] = (),
) -> str:
    """The slip that explains the data, what else may be the cause, and what to do.

    `series` holds the constants that series may not share instead; `left` is the p value of what it leaves;
    `closures` describe the data as well without a slip.
    """
    first, *others = (slip for slip in named if not _is_repeated(slip, named[0]))
    what, remedy = _words(problem, first)
    else_ = [f"closure {title}" for title in closures]
    else_ += [*(_named(problem, other, first) for other in others), *(short_words(name) for name in effects)]
    else_ += [f"series that do not share {series}"] if series else []
    alike = f", not told apart from {joined(else_, 'or')}" if else_ else ""
    p = f"p = {p_text(first.p)}; " if first.sd else ""
    if first.name in _SCALES:  # one of them harms where it is another
        remedy = "; or ".join([remedy, *(_words(problem, one)[1] for one in others if one.name in _SCALES)])
    if closures or set(effects) & {"sticking-law", "sliding-law"}:
        remedy = f"ifrfit compare tells closures from one another first; then {remedy}"
    of = f"series {first.series}" if first.series else "the table"
    fall = f"({p}-2 log likelihood falls by {first.drop:.3g})"
    if first.series:
        remedy = f"mend the rows of that series, or fit it alone with --series {first.series} ({remedy})"
    if left < REFUTED:
        return (
            f"no slip alone explains the misfit: in part {of} looks as if it had {what}{alike} {fall}, but "
            f"what is left then is no scatter (p = {p_text(left)}). Look for a further flaw or an effect, "
            f"and do not trust this one alone: {remedy}"
        )
    return f"{of} looks as if it had {what}{alike} {fall}: {remedy}"


def offset_words(problem: Problem, sizes: Array) -> str:
    """That the angles of each series are off by numbers of their own, and what to do."""
    named = list(zip(problem.series, sizes.tolist(), strict=True))
    each = ", ".join(f"{-size:+.1f} in {series}" for series, size in named[:_MOST_SERIES])
    more = ", ..." if len(named) > _MOST_SERIES else ""
    return (
        f"their angles of incidence are off by {each}{more} degrees, which explains as much: check the zero "
        "of the angle in each"
    )


def short_slip_words(problem: Problem, slip: Slip) -> str:
    """What it is, and in which series."""
    return _named(problem, slip, replace(slip, series=""))


def _named(problem: Problem, slip: Slip, first: Slip) -> str:
    """What it is, and in which series where that is another one than the first slip's."""
    what = _words(problem, slip)[0]
    if slip.series == first.series:
        return what
    return f"{what} in {f'series {slip.series}' if slip.series else 'all series'}"


def _is_repeated(slip: Slip, first: Slip) -> bool:
    """Whether a slip is the scale of spins that the first one has as a unit."""
    of_unit = first.name.removesuffix("-after") in SPIN_UNITS
    return of_unit and slip.name == "spin-scale" and slip.series == first.series


def _words(problem: Problem, slip: Slip) -> tuple[str, str]:
    """What it is, and what to do."""
    if not slip.sd:
        return _unsized(problem, slip)
    if slip.name == "inertia-factor":
        return _inertia(problem, slip)
    what, remedy = (_formatted(text, slip) for text in _SIZED.get(slip.name, _DRIFT))
    if slip.name == "spin-scale" and slip.is_least:
        return what, "check their unit (rpm, rev/s, rad/s), and radius against diameter"
    if slip.name in _SCALED and not slip.is_least:
        remedy += f"; to try it, divide {_SCALED[slip.name]} by {1.0 + slip.size:.4g}"
        if slip.name == "speed-scale" and math.isfinite(slip.e_n) and problem.rows.has_kind("normal"):
            remedy += f", which makes e_n {slip.e_n:.2g}"
    if slip.name == "speed-scale" and abs(slip.size) > _MUCH:
        what += ", which is much for a slip of the hand"
    return what, remedy


def flaw_words(slip: Slip) -> str:
    """What is off by one of the `FLAWS`, and by how much."""
    return _formatted(_SIZED[slip.name][0], slip)


def _formatted(text: str, slip: Slip) -> str:
    percent = f"{plus_minus(100.0 * slip.size, 100.0 * slip.sd)} %"
    return text.format(
        slip=slip,
        size=plus_minus(slip.size, slip.sd),
        opposite=plus_minus(-slip.size, slip.sd),
        percent=f"at least {abs(100.0 * slip.size):.0f} %" if slip.is_least else percent,
        most=plus_minus(abs(slip.size), slip.sd),
        large="large" if slip.size > 0.0 else "small",
        mend=f"take {slip.size:.2g} m/s off" if slip.size > 0.0 else f"add {-slip.size:.2g} m/s to",
        time=1000.0 * slip.size / GRAVITY,
        prior=max(1.0, math.ceil(abs(slip.size))),
        first=slip.middle - 0.5 * slip.size,
        last=slip.middle + 0.5 * slip.size,
    )


def _inertia(problem: Problem, slip: Slip) -> tuple[str, str]:
    factor, sd = (problem.inertia_factor * x for x in (1.0 + slip.size, slip.sd))
    bodies = [(j, body) for j, body in BODIES.items() if abs(j - factor) < _NEAR + 2.0 * sd]
    j, body = min(bodies, key=lambda pair: abs(pair[0] - factor), default=(factor, ""))
    like = f" ({body} {j:.4g})" if body else ""
    return f"another inertia factor, {plus_minus(factor, sd)}{like}", f"--inertia-factor {j:.4g}"


def _unsized(problem: Problem, slip: Slip) -> tuple[str, str]:
    name, observable = slip.name, slip.observable
    if name in ("zero-for-missing", "code-for-missing"):
        some = exclude_names(problem, slip.rows[:_LONGEST])
        more = " and so on" if len(slip.rows) > _LONGEST else ""
        return (
            f"{problem.rows.value[slip.rows[0]]:g} for 'not measured' in {observable} "
            f"({len(slip.rows)} of its cells)",
            f"empty these cells, or {' '.join(f'--exclude {one}' for one in some)}{more}",
        )
    axis = "x" if "-x" in name else "y"
    back = "positive is back-spin" if axis == "y" else "positive is minus the right-handed one"
    if name.startswith(("mixed-", "size-of-spin")):
        lines = list(dict.fromkeys(exclude_names(problem, slip.rows)))
        more = f" and {len(lines) - _MOST_LINES} more" if len(lines) > _MOST_LINES else ""
        where = f"lines ({', '.join(lines[:_MOST_LINES])}{more})"
        if name.startswith("size"):
            what = f"spin_{axis} (before) without its sign, which is the other one in {where}"
            return what, f"give the spins their signs ({back})"
        if "-of-spin" in name:
            what = f"spin_{axis} (before) of the opposite sign in some of its {where}"
            return what, f"turn the sign round in these lines ({back})"
        what, remedy = _MIXED[name]
        if name == "mixed-sign" and not problem.rows.incidence.spin_y.any():
            remedy += ", unless they are later bounces, whose spin before impact belongs into a column spin_y"
        return f"{observable} {what} in some of its {where}".strip(), remedy
    if name.startswith("sign-of-spin"):
        before, after = f"spin_{axis} (before)", f"spin_{axis}_after"
        columns = {"before": before, "after": after}.get(name.rpartition("-")[2], f"{before} and {after}")
        return f"the opposite sign in {columns}", f"turn the sign round in these columns ({back})"
    if name == "angle-from-wall":
        read = any("read as the angle from the wall" in note for note in problem.observations.notes)
        other, this = ("normal", "wall") if read else ("wall", "normal")
        return (
            f"angles of incidence from the {other}, which were read as those from the {this}",
            f"--convention angle=from-{other}",
        )
    if name.removesuffix("-after") in SPIN_UNITS:
        of, remedy = _SPIN_WORDS[name.removesuffix("-after")]
        return f"spins{' after impact' if name.endswith('-after') else ''} {of}", remedy
    if name == "sign" and observable == "beta":
        return "the opposite sign in beta", "--convention beta=opposite-sign"
    if name.startswith("shifted"):
        side, back = ("below", "up") if name.endswith("down") else ("above", "down")
        what, its, are = (observable, "its", "it is") if observable else ("all values", "their", "they are")
        return (
            f"{what} one line {side} the angle {are} of",
            f"move {what} {back} by a line, beside {its} angle",
        )
    parts = observable, observable.removesuffix("_deg"), name.removeprefix("meant-")
    what, remedy = (text.format(*parts) for text in _UNSIZED.get(name, _MEANT))
    return what, remedy
