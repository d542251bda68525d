"""Slips of the hand in a whole table: what the first lines call them, and the option that tries it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from hard_cases.case import FILE, HardCase, Told, command, put, refused
from hard_cases.identifiable import fitted, within
from hard_cases.synthetic import FAN, HEADER, TRUTH, noise, rows, values

from ifrfit import fit, rebound
from ifrfit.inference import FitResult
from ifrfit.inference.options import AngleErrors, Noise

METHODS = ("lsq", "exact")
VELOCITIES = ("v_x", "v_n", "spin_y_after")
ANGLES = np.linspace(4.0, 80.0, 40)
NOISE = 0.01
EXACT = values(FAN, "beta")
BETA = EXACT + noise(len(FAN), 0.02, 31)


def measured(
    gamma: np.ndarray = ANGLES, *, spin: np.ndarray | float = 0.0, j: float = 0.4, **constants: float
) -> list[np.ndarray]:
    """Velocities and spin after impact, as they are; e_n and others may differ from impact to impact."""
    state = rebound(gamma, 0.0, spin, degrees=True, inertia_factor=j, **{**TRUTH, "e_t": -0.85, **constants})
    return [state.v_x, state.v_n, state.spin_y]


def raw(read: list[np.ndarray], gamma: np.ndarray = ANGLES, first: int = 40) -> str:
    """A table of velocities and spins after impact, with noise and without a sigma."""
    text = HEADER
    for number, (name, value) in enumerate(zip(VELOCITIES, read, strict=True)):
        text += rows(gamma, value + noise(gamma.size, NOISE, first + number), None, name)
    return text


def turned(degrees: float) -> list[np.ndarray]:
    """What a camera sees that is turned against the wall."""
    v_x, v_n, spin = measured(ANGLES - degrees)
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return [v_x * cosine - v_n * sine, v_n * cosine + v_x * sine, spin]


def faster(share: float) -> list[np.ndarray]:
    """Velocities after impact on another scale than those before."""
    v_x, v_n, spin = measured()
    return [v_x * (1.0 + share), v_n * (1.0 + share), spin]


def stretched(share: float) -> list[np.ndarray]:
    """Lengths along the wall on another scale than those across it, before impact and after."""
    true = np.degrees(np.arctan(np.tan(np.radians(ANGLES)) / (1.0 + share)))
    speed = np.hypot((1.0 + share) * np.sin(np.radians(true)), np.cos(np.radians(true)))
    v_x, v_n, spin = measured(true)
    return [(1.0 + share) * v_x / speed, v_n / speed, spin / speed]


def energies() -> np.ndarray:
    """Kinetic energy of the contact point's and the normal motion after impact over that before."""
    return values(FAN, "beta_tot") ** 2 + noise(len(FAN), 0.005, 33)


def spinning() -> list[np.ndarray]:
    """Spheres that spun before impact, some more than others."""
    return measured(spin=0.1 * (1.0 + noise(ANGLES.size, 0.3, 50)))


def opposite() -> list[np.ndarray]:
    """The spin after impact with the other sign."""
    v_x, v_n, spin = measured()
    return [v_x, v_n, -spin]


def two_days() -> tuple[list[np.ndarray], np.ndarray]:
    """Impacts in no order, the later ones of a smaller e_n."""
    gamma = np.random.default_rng(8).permutation(ANGLES)
    e_n = np.where(np.arange(gamma.size) < 18, 0.94, 0.88)
    each = [measured(np.array([g]), e_n=float(e)) for g, e in zip(gamma, e_n, strict=True)]
    return [np.concatenate(column) for column in zip(*each, strict=True)], gamma


def beta(value: np.ndarray, gamma: np.ndarray | None = None) -> str:
    """A table of beta without a sigma."""
    return HEADER + rows(np.array(FAN, dtype=float) if gamma is None else gamma, value, None)


def centre() -> np.ndarray:
    """beta of the centre of the sphere."""
    return values(FAN, "beta_cm") + noise(len(FAN), 0.02, 32)


def zeros() -> np.ndarray:
    """Three cells of 0 where nothing was measured."""
    value = BETA.copy()
    value[[1, 2, 14]] = 0.0
    return value


def twice() -> tuple[list[np.ndarray], np.ndarray]:
    """A table some of whose lines were pasted a second time."""
    again = np.r_[np.arange(ANGLES.size), np.arange(8)]
    noisy = [v + noise(v.size, NOISE, 60 + i) for i, v in enumerate(measured())]
    return [v[again] for v in noisy], ANGLES[again]


def pasted() -> str:
    """The table of `twice`, which has its noise already."""
    read, gamma = twice()
    return HEADER + "".join(rows(gamma, v, None, name) for name, v in zip(VELOCITIES, read, strict=True))


def named(slip: str, *words: str) -> Callable[[FitResult], None]:
    """The slip is named first, with these words; no effect is blamed, and the first line says LOOK."""

    def check(result: FitResult) -> None:
        fact = result.facts["slips"]
        assert not fact.ok, fact.says
        assert fact.figures["called"][0].startswith(slip), fact.figures["called"]
        for word in words:
            assert word in fact.says, (word, fact.says)
        assert "effects" not in result.facts
        assert result.summary().startswith("LOOK  the table looks as if it had a slip in it")

    return check


def wide(**columns: np.ndarray) -> str:
    """A table of one line an impact."""
    lines = (",".join(f"{x:.5f}" for x in line) for line in zip(*columns.values(), strict=True))
    return "\n".join((",".join(columns), *lines)) + "\n"


def spun(given: Callable[[np.ndarray], np.ndarray]) -> str:
    """Spheres that spin either way, before impact by the numbers that a table has of it."""
    spin = np.resize([0.3, -0.2, 0.1, -0.35, 0.25], ANGLES.size)
    read = zip(VELOCITIES, measured(spin=spin), strict=True)
    after = {name: v + noise(v.size, NOISE, 70 + i) for i, (name, v) in enumerate(read)}
    return wide(gamma_deg=ANGLES, spin_y=given(spin), **after)


def beside_e_n(values: np.ndarray, e_n: np.ndarray, gamma: np.ndarray = ANGLES, **columns: np.ndarray) -> str:
    """Readings of beta and e_n, with noise."""
    read = {"beta": values + noise(values.size, NOISE, 75), "e_n": e_n + noise(values.size, NOISE, 76)}
    return wide(gamma_deg=gamma, **read, **columns)


def contact(gamma: np.ndarray = ANGLES, **constants: float) -> np.ndarray:
    """beta of the contact point."""
    v_x, _, spin = measured(gamma, **constants)
    return -(v_x + spin) / np.sin(np.radians(gamma))


def squares() -> str:
    """Every third reading of e_n a ratio of heights."""
    e_n = np.where(np.arange(ANGLES.size) % 3 == 0, 0.6**2, 0.6)
    return beside_e_n(contact(e_n=0.6), e_n)


def above_the_floor(height: float = 0.02) -> str:
    """Velocities as they were some metres above a floor."""
    gamma, speed = np.linspace(8.0, 65.0, ANGLES.size), np.resize([1.3, 3.5, 2.0, 2.7], ANGLES.size)
    fall = 2.0 * 9.81 * height / speed**2
    along, towards = np.sin(np.radians(gamma)), np.sqrt(np.cos(np.radians(gamma)) ** 2 + fall)
    v_x, v_n, spin = np.hypot(along, towards) * np.array(measured(np.degrees(np.arctan2(along, towards))))
    read = zip(VELOCITIES, (v_x, np.sqrt(v_n**2 - fall), spin), strict=True)
    after = {name: v + noise(v.size, NOISE, 80 + i) for i, (name, v) in enumerate(read)}
    return wide(gamma_deg=gamma, speed_m_s=speed, **after)


def moving(along: float, into: float) -> str:
    """Raw velocities of a wall that moves by some m/s."""
    speed, angle = np.resize([2.2, 3.9, 2.7, 3.3], ANGLES.size), np.radians(ANGLES)
    v_x, v_n, spin = measured()
    read = {
        "u_x_m_s": speed * np.sin(angle) + along,
        "u_z_m_s": speed * np.cos(angle) + into,
        "v_x_m_s": speed * v_x + along,
        "v_z_m_s": -speed * v_n + into,
        "r_omega_y_after_m_s": speed * spin,
    }
    read = {name: v + noise(v.size, NOISE, 95 + i) for i, (name, v) in enumerate(read.items())}
    omega = read.pop("r_omega_y_after_m_s") / 0.005
    return wide(**read, omega_y_after_rad_s=omega, radius_mm=np.full(omega.size, 5.0))


def rounded() -> str:
    """Impacts at any angle, which is written in steps of 5 degrees."""
    gamma = np.random.default_rng(9).uniform(10.0, 80.0, 60)
    read = zip(VELOCITIES, measured(gamma), strict=True)
    after = {name: v + noise(v.size, 0.005, 85 + i) for i, (name, v) in enumerate(read)}
    return wide(gamma_deg=5.0 * np.round(gamma / 5.0), **after)


def shifted() -> str:
    """Impacts in no order, whose beta stands a line too low."""
    gamma = np.random.default_rng(7).permutation(ANGLES)
    e_n = np.full(gamma.size, TRUTH["e_n"])
    return beside_e_n(np.roll(contact(gamma), 1), e_n, gamma)


def shuffled() -> str:
    """A column of beta that goes with none of the angles."""
    return beta(np.random.default_rng(6).permutation(BETA))


def one_too_quiet() -> str:
    """Two series with one sigma, one of which scatters ten times less."""
    text = HEADER
    for number, (series, share) in enumerate((("A", 1.0), ("B", 0.1))):
        text += rows(FAN, EXACT + noise(len(FAN), share * 0.02, 90 + number), 0.02, "beta", series)
    return text


def says(name: str, *words: str, headline: str) -> Callable[[FitResult], None]:
    """A fact fails with these words, and the first line has its headline."""

    def check(result: FitResult) -> None:
        fact = result.facts[name]
        assert not fact.ok, fact.says
        for word in words:
            assert word in fact.says, (word, fact.says)
        assert result.summary().startswith(f"LOOK  {headline}")

    return check


def doubled(result: FitResult) -> None:
    fact = result.facts["duplicates"]
    assert not fact.ok
    assert "stand in the table twice" in fact.says
    assert result.summary().startswith("LOOK  impacts stand in the table twice")


def mended(result: FitResult) -> None:
    """With the offset fitted the constants are right, and nothing is wrong."""
    within(result, e_n=TRUTH["e_n"], e_t=-0.85, mu=TRUTH["mu"])
    assert abs(result.facts["angle_offset"].figures["value"] - 2.0) < 0.5
    assert all(fact.ok for fact in result.facts.values()), result.summary()


def refusing(text: str) -> Callable[[Path], Told]:
    """The command line on a table."""

    def run(folder: Path) -> Told:
        put(folder, text)
        return command(folder, ["fit", FILE, "--out", "results"])

    return run


def free(text: str, **options: Any) -> Callable[[Path, str], FitResult]:
    """Fit a table with every constant free."""
    return lambda folder, method: fit(put(folder, text), method=method, **options)


def slip(
    name: str,
    what: str,
    answer: str,
    run: Callable[..., object],
    check: Callable[..., None],
) -> HardCase:
    return HardCase(name, "slips", what, answer, run, check, METHODS)


IDS = "impact_id,gamma_deg,v_x,v_n\n" + "".join(
    f"{number},{gamma},{0.5 + 0.01 * number},{0.6 - 0.01 * number}\n"
    for gamma in (20, 40, 60)
    for number in range(1, 5)
)
CODES = "gamma_deg,beta\n" + "".join(
    f"{g},{-999 if i in (3, 8) else v:.4f}\n" for i, (g, v) in enumerate(zip(FAN, BETA, strict=True))
)
DAYS, OF_DAYS = two_days()

CASES = (
    slip(
        "a camera turned by 0.5 degrees",
        "Velocities and spins of a camera that is turned against the wall by 0.5 degrees.",
        "The first line says that the table has a slip: a turned camera, with the angle and what to do.",
        free(raw(turned(0.5))),
        named("camera-turn", "a camera turned against the wall by 0."),
    ),
    slip(
        "a camera turned by 1 degree",
        "The same by 1 degree.",
        "The same; neither another inertia factor nor rolling friction is blamed.",
        free(raw(turned(1.0))),
        named("camera-turn", "a camera turned against the wall by"),
    ),
    slip(
        "set angles off by 1 degree",
        "Velocities and spins at angles that were one degree larger than set.",
        "The first line says that the table has a slip: angles off, with the number and --angle-offset.",
        free(raw(measured(ANGLES + 1.0))),
        named("angle-offset", "angles of incidence off by -", "--angle-offset"),
    ),
    slip(
        "an angle offset that is fitted",
        "The same by 2 degrees, with --angle-offset 1.0.",
        "The constants are right, the offset is, and nothing is found wrong.",
        free(raw(measured(ANGLES + 2.0)), noise=Noise(angles=AngleErrors(offset_sd=1.0))),
        mended,
    ),
    slip(
        "speeds off by 2 %",
        "Velocities after impact on a scale 2 % larger than those before.",
        "The first line says that the table has a slip: the scale of the speeds, with the number.",
        free(raw(faster(0.02))),
        named("speed-scale", "speeds after impact"),
    ),
    slip(
        "lengths along the wall off by 7 %",
        "Velocities and spins, lengths along the wall 7 % short, as in an oblique view.",
        "The first line says that the table has a slip: that scale or the one of spins, with both remedies.",
        free(raw(stretched(-0.07))),
        named("s", "lengths along the wall -", "spins ", "check that pixels are squares"),
    ),
    slip(
        "a restitution of energies",
        "beta_tot as a ratio of energies, which is its square.",
        "The first line says that the table has a slip: take the square root.",
        fitted(HEADER + rows(np.array(FAN, dtype=float), energies(), None, "beta_tot")),
        named("squared beta_tot", "take the square root of beta_tot"),
    ),
    slip(
        "spin that was not measured",
        "Spheres that spun by R omega/u = 0.1 or so before impact, without a column for it.",
        "The first line says that the table has a slip: spin before impact, with its size and the column.",
        free(raw(spinning())),
        named("incoming-spin", "spin before impact that is not in it", "spin_y"),
    ),
    slip(
        "spin after of the wrong sign",
        "Velocities and spins, the spin after impact with the other sign.",
        "The first line says that the table has a slip: the sign of the spin after; no rolling friction.",
        free(raw(opposite())),
        named("sign-of-spin-y-after", "the opposite sign in spin_y_after"),
    ),
    slip(
        "a hollow ball taken for a solid one",
        "Velocities and spins of a thin hollow ball, J = 2/3, with the inertia factor of a solid one.",
        "The first line says that the table has a slip: another inertia factor, with --inertia-factor.",
        free(raw(measured(j=2.0 / 3.0))),
        named("inertia-factor", "another inertia factor", "--inertia-factor 0.6667"),
    ),
    slip(
        "e_n that differs by day",
        "Impacts in no order of the angle, e_n 0.94 in the first part of the table and 0.88 in the rest.",
        "The first line says that the table has a slip: an e_n that changes, with --separate e_n; no yield.",
        free(raw(DAYS, OF_DAYS)),
        named("restitution-drift", "a drift of e_n along it", "--separate e_n"),
    ),
    slip(
        "angles from the wall",
        "beta over the angle from the wall in a column of angles from the normal.",
        "The first line says that the table has a slip, with --convention angle=from-wall.",
        fitted(beta(BETA, 90.0 - np.array(FAN))),
        named("angle-from-wall", "--convention angle=from-wall"),
    ),
    slip(
        "degrees for radians",
        "beta over the angle in radians in a column of degrees.",
        "The first line says that the table has a slip, with --convention angle=rad.",
        fitted(beta(BETA, np.radians(FAN))),
        named("angle-in-radians", "--convention angle=rad"),
    ),
    slip(
        "angles in gon",
        "Velocities and spins over angles of 400 a circle in a column of degrees.",
        "The first line says that the table has a slip: angles in gon, to be multiplied by 0.9.",
        free(raw(measured(), ANGLES / 0.9)),
        named("angle-in-gon", "multiply them by 0.9"),
    ),
    slip(
        "velocities of the contact point 10 % off",
        "beta and e_n, beta 10 % too large.",
        "The first line says that the table has a slip: the scale of the contact point's velocities first.",
        free(beside_e_n(1.1 * contact(), np.full(ANGLES.size, TRUTH["e_n"]))),
        named("contact-scale", "velocities of the contact point after impact"),
    ),
    slip(
        "angles rounded to 5 degrees",
        "Velocities and spins of impacts at any angle, which is written in steps of 5 degrees.",
        "The first line says that the scatter is that of angles; the details give the step and the option.",
        free(rounded()),
        says(
            "angle_scatter",
            "as where they are rounded to 5 degrees",
            "--sigma-gamma 1.4",
            headline="the scatter is that of angles with errors",
        ),
    ),
    slip(
        "spins before impact without their sign",
        "Velocities and spins of spheres that spin either way, spins before impact all positive.",
        "The first line says that the table has a slip: the size of the spin before, with the lines.",
        free(spun(np.abs)),
        named("size-of-spin-y-before", "without its sign"),
    ),
    slip(
        "some spins before impact of the other sign",
        "The same, every fourth spin before impact of the other sign.",
        "The first line says that the table has a slip: the sign of the spin before in some lines.",
        free(spun(lambda spin: np.where(np.arange(spin.size) % 4 == 0, -spin, spin))),
        named("mixed-sign-of-spin-y-before", "of the opposite sign in some of its lines"),
    ),
    slip(
        "squares among readings of e_n",
        "beta and e_n, every third e_n a ratio of heights.",
        "The first line says that the table has a slip: squares in some lines, which it names.",
        free(squares()),
        named("mixed-squared e_n", "take the square root of the values of these lines"),
    ),
    slip(
        "a column sorted by itself",
        "beta in ascending order beside angles in none.",
        "The first line says that the table has a slip: a column that was sorted by itself.",
        fitted(beta(np.sort(BETA), np.random.default_rng(4).permutation(np.array(FAN, dtype=float)))),
        named("sorted beta", "sorted by itself"),
    ),
    slip(
        "a column shifted by a line",
        "beta one line below the angle that it is of.",
        "The first line says that the table has a slip: values one line below their angle.",
        free(shifted()),
        named("shifted-down beta", "one line below the angle"),
    ),
    slip(
        "a column shuffled by itself",
        "beta that goes with none of the angles.",
        "The first line says that readings go with no angle.",
        fitted(shuffled()),
        says("unrelated_readings", headline="readings do not go with the angle"),
    ),
    slip(
        "velocities above the floor",
        "Velocities and spins as they were 2 cm above a floor, at 1.3 to 3.5 m/s.",
        "The first line says that the table has a slip: a height above the wall, in metres; no viscosity.",
        free(above_the_floor()),
        named("height", "above the wall"),
    ),
    slip(
        "a wall that moves away",
        "Raw velocities and spins, 2 to 4 m/s, of a wall that moves along its normal by 5 cm/s.",
        "The first line says that the table has a slip: velocities off by that number; no adhesion.",
        free(moving(0.0, 0.05)),
        named("zero-across", "velocities across the wall before impact and after 0.0", "does the wall move"),
    ),
    slip(
        "a belt",
        "The same of a wall that moves along itself by 0.3 m/s.",
        "The first line says that the table has a slip: velocities off by that number; no law of sticking.",
        free(moving(0.3, 0.0)),
        named("zero-along", "velocities along the wall before impact and after 0.", "does the wall move"),
    ),
    slip(
        "one series scatters too little",
        "beta of two series with one sigma, one of which scatters ten times less.",
        "The first line says that values scatter less than their sigma; the details name the series.",
        fitted(one_too_quiet()),
        says("scatter_too_small", "beta in B", headline="the data scatter less than their sigma"),
    ),
    slip(
        "the sign of beta",
        "beta with the other sign.",
        "The first line says that the table has a slip, with --convention beta=opposite-sign.",
        fitted(beta(-BETA)),
        named("sign beta", "--convention beta=opposite-sign"),
    ),
    slip(
        "centre for contact",
        "beta of the centre in a column of that of the contact point.",
        "The first line says that the table has a slip, with --convention beta=centre.",
        fitted(beta(centre())),
        named("meant-beta_cm", "--convention beta=centre"),
    ),
    slip(
        "beta in percent",
        "beta times 100.",
        "The first line says that the table has a slip: beta in percent.",
        fitted(beta(100.0 * BETA)),
        named("percent beta", "divide beta by 100"),
    ),
    slip(
        "0 for not measured",
        "A column of beta with 0 in three cells.",
        "The first line says that the table has a slip: 0 for 'not measured', with the lines to leave out.",
        fitted(beta(zeros())),
        named("zero-for-missing beta", "--exclude 3 --exclude 4 --exclude 16"),
    ),
    slip(
        "lines pasted twice",
        "Forty impacts, eight of which stand in the table a second time.",
        "The first line says that impacts stand in the table twice; no law of sticking is blamed.",
        free(pasted()),
        doubled,
    ),
    HardCase(
        "an impact_id that starts anew",
        "slips",
        "Impacts numbered from 1 to 4 at each of three angles.",
        "Refused with exit status 3, nothing written: both lines are named; number them through.",
        refusing(IDS),
        refused("impact '1' has the angle", "Number the impacts through the whole table"),
    ),
    HardCase(
        "-999 for not measured",
        "slips",
        "A column of beta with -999 in two cells.",
        "Refused with exit status 3, nothing written: a code for 'not measured', with its line.",
        refusing(CODES),
        refused("-999 looks like a code for 'not measured'"),
    ),
)
