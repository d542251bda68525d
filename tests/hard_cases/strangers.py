"""Tables of strangers: what contradicts itself, misleads, or is no sphere on a wall."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from hard_cases.case import FILE, HardCase, Told, command, put, refused
from hard_cases.identifiable import fitted, statuses
from hard_cases.synthetic import FAN, HEADER, noise, rows, table, values

from ifrfit import fit, rebound
from ifrfit.inference import FitResult

METHODS = ("lsq", "exact")
WIDE = "gamma_deg,beta,"
SUPERBALL = "gamma_deg,e_n,sigma_e_n,beta,sigma_beta\n25,0.78,0.01,0.49,0.03\n"


def _two_series(sigma: float | None, spread: float, **second: float) -> str:
    text = HEADER
    for number, (series, constants) in enumerate((("first", {}), ("second", second))):
        value = values(FAN, "beta", **constants) + noise(len(FAN), spread, 11 + number)
        text += rows(FAN, value, sigma, series=series)
    return text


def _with_e_n(readings: np.ndarray) -> str:
    beta = values(FAN, "beta") + noise(len(FAN), 0.02, 3)
    return HEADER + rows(FAN, beta, None) + rows(FAN, readings, None, "e_n")


def _looks(name: str, *words: str) -> Callable[[FitResult], None]:
    """The fact fails with these words, and the first line says so."""

    def check(result: FitResult) -> None:
        fact = result.facts[name]
        assert not fact.ok
        for word in words:
            assert word in fact.says, (word, fact.says)
        assert result.summary().startswith("LOOK")

    return check


def _methods_agree(result: FitResult) -> None:
    """Two noises that let the optimum lie at either series: the first line says so, whatever the method."""
    _looks("pooling", "the series do not share mu", "--separate mu --separate e_t")(result)
    for name, of_first, of_second in (("mu", 0.14, 0.25), ("e_t", -0.85, -0.70)):
        low, high = result.constants[name].interval95
        assert low - 0.01 <= of_first <= high + 0.01 or low - 0.01 <= of_second <= high + 0.01


def _misread_angles(result: FitResult) -> None:
    _looks("angle_scatter", "each angle of incidence", "--angle-errors effective --sigma-gamma 1.")(result)
    assert not {name for name in ("truncation", "mixture", "growing_scatter") if name in result.facts}
    assert result.facts["outliers"].ok


def _nothing_hidden(result: FitResult) -> None:
    said = " ".join(result.assumed)
    for words in (
        "inertia factor 0.4 (solid sphere)",
        "no spin before impact",
        "errors as large as the scatter",
    ):
        assert words in said, said


def _run_through(result: FitResult) -> None:
    """No row is an outlier because the constants run through it."""
    assert result.facts["outliers"].ok
    assert float(result.points["standardised"].abs().max()) < 5.0


def _apart(result: FitResult) -> None:
    _looks("pooling", "the series do not share mu", "--separate mu")(result)
    assert "effects" not in result.facts


def _given_and_estimated(result: FitResult) -> None:
    assert result.noise.policy == "mixed"
    assert "errors of e_n as large as the scatter, those of beta as given" in result.assumed
    assert all(fact.ok for fact in result.facts.values())


def _silent_prior(result: FitResult) -> None:
    assert statuses(result) == {"e_n": "not_determined", "e_t": "determined", "mu": "not_determined"}


def _confined(result: FitResult) -> None:
    assert statuses(result) == {"e_n": "prior", "e_t": "determined", "mu": "prior"}
    assert "your bounds of e_n" in result.constants["mu"].reason


def _rocks(result: FitResult) -> None:
    _looks("normal_restitution", "a shape that is not round does, as of faceted rocks")(result)
    assert "effects" not in result.facts


def _glass(result: FitResult) -> None:
    assert all(fact.ok or name == "at_bound" for name, fact in result.facts.items())
    for name, low, high in (("e_n", 0.96, 0.98), ("mu", 0.086, 0.098)):
        assert low < result.constants[name].value < high
    assert (result.fit.n_sticking, result.fit.n_sliding) == (13, 11)


def _of_dataset(name: str) -> Callable[[Path, str], FitResult]:
    return lambda folder, method: fit(name, method=method)


def _command(text: str, *options: str) -> Callable[[Path], Told]:
    def run(folder: Path) -> Told:
        put(folder, text)
        return command(folder, ["fit", FILE, "--out", "results", *options])

    return run


def _usage(*words: str) -> Callable[[Told], None]:
    def check(told: Told) -> None:
        assert told.status == 2
        assert told.left == ()
        for word in words:
            assert word in told.err, (word, told.err)

    return check


def _never_offered(told: Told) -> None:
    refused("beta_err", "sigma_beta")(told)
    assert "beta_cm" not in told.err


def _uncertainties(folder: Path) -> list[Told]:
    names = ("beta_error", "u_beta", "unc_beta", "dbeta", "Delta_beta", "std_beta", "beta_se")
    return [_command(f"{WIDE}{name}\n30,0.1,0.02\n60,-0.4,0.02\n")(folder) for name in names]


def _all_never_offered(every: list[Told]) -> None:
    for told in every:
        refused("looks like an uncertainty", "sigma_beta")(told)
        assert "beta_cm" not in told.err


def _in_one_series(value: np.ndarray, gamma: np.ndarray | None = None) -> str:
    """A table of two series, the second of which is read as given."""
    angles = np.array(FAN, dtype=float) if gamma is None else gamma
    first = values(FAN, "beta") + noise(len(FAN), 0.02, 21)
    return HEADER + rows(FAN, first, None, series="A") + rows(angles, value, None, series="B")


def _hollow() -> str:
    """v_x and v_n of a thin hollow ball."""
    state = rebound(np.array(FAN), degrees=True, e_n=0.9, e_t=-0.85, mu=0.14, inertia_factor=2.0 / 3.0)
    each = (("v_x", state.v_x, 33), ("v_n", state.v_n, 34))
    return HEADER + "".join(rows(FAN, v + noise(len(FAN), 0.005, n), None, name) for name, v, n in each)


def _drifting() -> np.ndarray:
    """Errors of 0.03, each like the one before by 0.9."""
    found = noise(len(FAN) * 2, 0.03, 2)
    for i in range(1, found.size):
        found[i] = 0.9 * found[i - 1] + math.sqrt(0.19) * found[i]
    return found


def _two_balls() -> str:
    """Impacts of mu 0.09 and 0.16 in turn, in one series."""
    angles = np.repeat(FAN, 2)
    mu = np.resize([0.09, 0.16, 0.16, 0.09, 0.09], angles.size)
    value = np.array([values((g,), "beta", mu=float(m))[0] for g, m in zip(angles, mu, strict=True)])
    return HEADER + rows(angles, value + noise(angles.size, 0.02, 6), None)


def _one_angle_off() -> str:
    """Five repeats at each of eight angles, those at 40 degrees higher by 0.15."""
    angles = np.repeat(np.arange(10.0, 81.0, 10.0), 5)
    value = values(angles, "beta") + noise(angles.size, 0.03, 3) + np.where(angles == 40.0, 0.15, 0.0)
    return HEADER + rows(angles, value, None) + rows(angles, 0.94 + noise(angles.size, 0.02, 4), None, "e_n")


def _read_repeatedly() -> str:
    """Two readings of each of 30 impacts, which differ by a tenth of what impacts do."""
    angles = np.tile(np.random.default_rng(5).uniform(5.0, 80.0, 30).round(1), 2)
    text = HEADER
    for seed, observable in ((6, "beta"), (8, "e_n")):
        of_impact = np.tile(noise(30, 0.03, seed), 2)
        value = values(angles, observable) + of_impact + noise(angles.size, 0.003, seed + 1)
        text += rows(angles, value, None, observable)
    return text


def _wearing() -> str:
    """40 impacts at angles in no order, while mu rises from 0.10 to 0.16."""
    angles = np.random.default_rng(9).uniform(5.0, 80.0, 40)
    each = zip(angles, np.linspace(0.10, 0.16, 40), strict=True)
    value = np.array([values((g,), "beta", mu=float(mu))[0] for g, mu in each])
    return HEADER + rows(angles, value + noise(40, 0.02, 10), None)


def _filmed() -> str:
    """Errors of 0.012 in the velocities that beta is the ratio of."""
    angles = np.linspace(3.0, 80.0, 60)
    sigma = 0.012 / np.sin(np.radians(angles))
    return HEADER + rows(angles, values(angles, "beta") + noise(60, sigma, 11), None)


def _misread() -> str:
    """60 beta of noise 0.01, whose angles were read with errors of 1.3 degrees each."""
    angles = np.linspace(5.0, 80.0, 60)
    value = values(angles + noise(60, 1.3, 13), "beta") + noise(60, 0.01, 14)
    return HEADER + rows(angles, value, None)


def _partly_in_percent() -> str:
    """Every third of 34 beta in percent."""
    angles = np.tile(FAN, 2)
    value = values(angles, "beta") + noise(angles.size, 0.02, 12)
    value[::3] *= 100.0
    return HEADER + rows(angles, value, None)


SECOND = values(FAN, "beta") + noise(len(FAN), 0.02, 22)
DOUBLED = np.repeat(FAN, 2)


def _case(
    name: str,
    what: str,
    answer: str,
    run: Callable[..., Any],
    check: Callable[[Any], None],
    *,
    fits: bool = True,
) -> HardCase:
    return HardCase(name, "strangers", what, answer, run, check, METHODS if fits else ())


CASES = (
    _case(
        "two series of different mu",
        "Two series of one table, made with mu of 0.12 and 0.20, without a sigma; e_n is given.",
        "The first line says that the series do not share their constants, with the p-value, both values and "
        "--separate mu; no effect is blamed.",
        fitted(_two_series(None, 0.02, mu=0.20)),
        _apart,
    ),
    _case(
        "two series that differ a little",
        "Two series made with mu of 0.14 and 0.16, noise 0.02, without a sigma.",
        "The first line says that the series do not share their constants, with --separate mu.",
        fitted(_two_series(None, 0.02, mu=0.16)),
        _looks("pooling", "the series do not share mu", "--separate mu"),
    ),
    HardCase(
        "two noises, an optimum at either series",
        "strangers",
        "Two series of mu 0.14 and 0.25, e_t -0.85 and -0.70, with --separate noise.",
        "Every method says in its first line that the series do not share their constants.",
        fitted(
            HEADER
            + rows(FAN, values(FAN, "beta", mu=0.14, e_t=-0.85) + noise(17, 0.02, 41), None, series="A")
            + rows(FAN, values(FAN, "beta", mu=0.25, e_t=-0.70) + noise(17, 0.02, 42), None, series="B"),
            separate="noise",
        ),
        _methods_agree,
        ("lsq", "profile", "exact", "mcmc"),
    ),
    _case(
        "what nobody said",
        "beta without a sigma, a spin or an inertia factor.",
        "The output says that J = 0.4, no spin and errors as large as the scatter are assumed.",
        fitted(table(sigma=None, true_sigma=0.02, seed=8)),
        _nothing_hidden,
    ),
    _case(
        "one row that alone knows a constant",
        "Ten sliding impacts and a single sticking one, without a sigma: its residual is nothing.",
        "It is no outlier.",
        fitted(table((10.0, *range(40, 86, 5)), true_sigma=0.02, seed=9, e_t=-0.85)),
        _run_through,
    ),
    _case(
        "series of different noise",
        "Two series of the same constants, one with six times the scatter of the other, without a sigma.",
        "The first line says that the series do not share their noise, with --separate noise.",
        fitted(
            HEADER
            + rows(FAN, values(FAN, "beta") + noise(len(FAN), 0.01, 5), None, series="fine")
            + rows(FAN, values(FAN, "beta") + noise(len(FAN), 0.06, 6), None, series="rough")
        ),
        _looks("unequal_noise", "--separate noise"),
    ),
    _case(
        "a sigma for beta alone",
        "Values of beta with a sigma of 0.005 in one half and of 0.08 in the other, beside readings of e_n "
        "without one.",
        "The given sigmas are used and the noise of e_n is estimated, which the output says; no outlier.",
        fitted(
            HEADER
            + rows(FAN[::2], values(FAN[::2], "beta") + noise(len(FAN[::2]), 0.005, 7), 0.005)
            + rows(FAN[1::2], values(FAN[1::2], "beta") + noise(len(FAN[1::2]), 0.08, 8), 0.08)
            + rows(FAN[:5], 0.9 + noise(5, 0.01, 9), None, "e_n"),
            fix={},
        ),
        _given_and_estimated,
    ),
    _case(
        "a hollow ball without spins",
        "Velocities after impact of a thin hollow ball, J = 2/3, fitted as those of a solid one.",
        "The first line says that the table has a slip: another inertia factor, or spin before impact.",
        fitted(_hollow(), fix={}),
        _looks("slips", "thin hollow ball 0.6667", "spin before impact", "--inertia-factor 0.6667"),
    ),
    _case(
        "bounds that exclude the data",
        "Values of beta made with e_t = -0.98, under --bounds e_t=-0.8,-0.5.",
        "The first line says that the data contradict a value that was taken for known: the bound of e_t.",
        fitted(
            HEADER + rows(FAN, values(FAN, "beta") + noise(len(FAN), 0.02, 31), None),
            bounds={"e_t": (-0.8, -0.5)},
        ),
        _looks("prior_conflict", "your bound e_t >= -0.8", "without --bounds e_t they say -0.9"),
    ),
    _case(
        "one mean of e_n in every row",
        "Values of beta beside one mean of e_n, 0.9302, copied down all rows with its sigma.",
        "The first line says that one reading stands in every row; no noise is advised.",
        fitted(
            HEADER
            + rows(FAN, values(FAN, "beta") + noise(len(FAN), 0.02, 32), 0.02)
            + rows(FAN, np.full(len(FAN), 0.9302), 0.02, "e_n"),
            fix={},
        ),
        _looks("repeated_number", "e_n is 0.9302 in all 17 rows", "one reading, not 17"),
    ),
    _case(
        "the opposite sign in one series",
        "Two series of beta, the second with the other sign, without a sigma.",
        "The first line says that the table has a slip, with the series; constants of each are not advised.",
        fitted(_in_one_series(-SECOND)),
        _looks("slips", "series B looks as if it had the opposite sign in beta", "beta=opposite-sign"),
    ),
    _case(
        "angles from the wall in one series",
        "Two series of beta, the second over the angle from the wall.",
        "The first line says that the table has a slip, with the series and the option.",
        fitted(_in_one_series(SECOND, 90.0 - np.array(FAN, dtype=float))),
        _looks("slips", "series B looks as if it had angles of incidence from the wall", "angle=from-wall"),
    ),
    _case(
        "beta without its sign",
        "Readings of |beta|.",
        "The first line says that the table has a slip: beta without its sign.",
        fitted(HEADER + rows(FAN, np.abs(SECOND), None)),
        _looks("slips", "beta without its sign"),
    ),
    _case(
        "errors that drift",
        "beta twice at each angle, in the order of the angle, errors alike from row to row by 0.9.",
        "The first line says that errors are not independent, with the factor by which intervals are too "
        "short.",
        fitted(HEADER + rows(DOUBLED, values(DOUBLED, "beta") + _drifting(), None)),
        _looks("independence", "intervals are too short by a factor of some"),
    ),
    _case(
        "two balls in one series",
        "Impacts of mu 0.09 and 0.16 in one series, in no order.",
        "The first line says that the table looks as if it held impacts of two kinds, with both values.",
        fitted(_two_balls()),
        _looks("mixture", "impacts of two kinds: mu 0.09", "--separate mu"),
    ),
    _case(
        "9.99 for not measured",
        "A column of beta with 9.99 in three cells, every other value below 1.",
        "Refused with exit status 3, nothing written: a code for 'not measured'.",
        _command("gamma_deg,beta\n" + "".join(f"{g},{9.99 if g < 20 else 0.1}\n" for g in FAN)),
        refused("9.99 looks like a code for 'not measured'"),
        fits=False,
    ),
    _case(
        "e_n in two digits",
        "Readings of e_n about 0.9037 that scatter by 0.0015, written with two digits, beside beta.",
        "The first line says that readings are rounded to coarser steps than they scatter, with the value "
        "and the sd to give in their place.",
        fitted(_with_e_n(np.round(0.9037 + noise(len(FAN), 0.0015, 4), 2)), fix={}),
        _looks("rounded_readings", "in steps of 0.01", "--observable beta --prior e_n=0.90"),
    ),
    _case(
        "beta clipped",
        "Readings of beta, those above 0.39 written as 0.39.",
        "The first line says that values look clipped, with their number and place.",
        fitted(HEADER + rows(FAN, np.minimum(SECOND, 0.39), None)),
        _looks("censoring", "values of beta are 0.39 exactly, the largest of all"),
    ),
    _case(
        "one sigma of 1e-12",
        "One sigma of 1e-12 beside those of 0.02.",
        "Refused with exit status 3, nothing written: the median is given.",
        _command(WIDE + "sigma_beta\n" + "".join(f"{g},0.1,{1e-12 if g == 45 else 0.02}\n" for g in FAN)),
        refused("10,000 times smaller than the median sigma of beta, 0.02"),
        fits=False,
    ),
    _case(
        "e_n that falls with the angle",
        "Readings of e_n that fall from 0.95 to 0.60 between 5 and 85 degrees, beside beta.",
        "The first line says that the readings contradict one value, with the p-value and both ends.",
        fitted(_with_e_n(0.95 - 0.35 * (np.array(FAN) - 5.0) / 80.0 + noise(len(FAN), 0.01, 4)), fix={}),
        _looks("normal_restitution", "is not one value", "degrees"),
    ),
    _case(
        "e_n fixed against its readings",
        "Readings of e_n about 0.94 beside --fix e_n=0.5.",
        "The first line says that the readings contradict what was fixed, with both numbers.",
        fitted(_with_e_n(0.94 + noise(len(FAN), 0.01, 4)), fix={"e_n": 0.5}),
        _looks("normal_restitution", "but e_n is fixed at 0.5"),
    ),
    _case(
        "e_n above 1",
        "Readings of e_n about 1.1, as of a camera whose scale is not the same before and after.",
        "The first line says that they contradict what is taken of e_n: they lie above 1.",
        fitted(_with_e_n(1.1 + noise(len(FAN), 0.02, 4)), fix={}),
        _looks("normal_restitution", "above 1"),
    ),
    _case(
        "sigma far too large",
        "Values that scatter by 0.003 with a sigma of 0.05.",
        "The first line says that the data scatter less than their sigma, with chi2 and its p-value.",
        fitted(table(sigma=0.05, true_sigma=0.003, seed=7)),
        _looks("scatter_too_small", "sigma is too large"),
    ),
    _case(
        "sigma too small",
        "Values that scatter by 0.04 with a sigma of 0.02.",
        "The first line says that the data scatter more than their sigma, before the law is blamed.",
        fitted(table(sigma=0.02, true_sigma=0.04, seed=6)),
        _looks("scatter_too_large", "sigma is too small"),
    ),
    _case(
        "a prior that says nothing",
        "beta alone, which fixes kappa only, with --prior e_n=0.9,5.",
        "e_n and mu stay not determined, as without the prior.",
        fitted(table(sigma=0.02, seed=8, e_t=-0.85), fix={}, prior={"e_n": (0.9, 5.0)}),
        _silent_prior,
    ),
    _case(
        "bounds that decide",
        "beta alone with --bounds e_n=0.85,0.95.",
        "The status of e_n and mu is prior: they rest on the bounds.",
        fitted(table(sigma=0.02, seed=8, e_t=-0.85), fix={}, bounds={"e_n": (0.85, 0.95)}),
        _confined,
    ),
    _case(
        "a prior outside the domain",
        "A table of beta with --prior e_n=1.1,0.02.",
        "Refused with exit status 2, nothing written: the domain is named.",
        _command(table(sigma=0.02, seed=8), "--prior", "e_n=1.1,0.02"),
        _usage("e_n=1.1,0.02", "domain [0, 1]"),
        fits=False,
    ),
    _case(
        "beta_err",
        "A column beta_err beside beta.",
        "Refused with exit status 3, nothing written: an uncertainty is meant, sigma_beta, never beta_cm.",
        _command(WIDE + "beta_err\n30,0.1,0.02\n60,-0.4,0.02\n"),
        _never_offered,
        fits=False,
    ),
    _case(
        "other words for an uncertainty",
        "Columns such as beta_error, u_beta, unc_beta, dbeta, Delta_beta, std_beta, beta_se beside beta.",
        "Refused with exit status 3, nothing written: sigma_beta is offered for each, never beta_cm.",
        _uncertainties,
        _all_never_offered,
        fits=False,
    ),
    _case(
        "faceted rocks",
        "75 real drops of limestone blocks, whose e_n rises with the angle beyond 1 (`wang-2018-limestone`).",
        "Refuted in the first line for their shape: e_n is not one value; no yield and no other effect is "
        "blamed.",
        _of_dataset("wang-2018-limestone"),
        _rocks,
    ),
    _case(
        "a superball by closure F",
        "One bounce of a superball on granite, e_n 0.78 and beta 0.49 (Cross 2010), fitted by closure F.",
        "The first line says that the reading lies beyond what the closure can give: in F the contact point "
        "at most stops.",
        fitted(SUPERBALL, fix={}, closure="f"),
        _looks("beyond_closure", "at most stops", "--closure fr or ifr"),
    ),
    _case(
        "glass spheres on each other",
        "24 real collisions of equal glass spheres, sticking and sliding (`cornell-glass`).",
        "Taken in as a wall in the relative frame: one set of constants holds for both regimes.",
        _of_dataset("cornell-glass"),
        _glass,
    ),
    _case(
        "spheres of unequal size",
        "A table with --convention pair=unequal-spheres.",
        "Refused with exit status 2, nothing written: only equal spheres are read as a wall.",
        _command(table(sigma=0.02, seed=8), "--convention", "pair=unequal-spheres"),
        _usage("pair=unequal-spheres", "Two equal spheres are a wall in the relative frame"),
        fits=False,
    ),
    _case(
        "one angle that was set wrongly",
        "Five repeats at each of eight angles; those at 40 degrees are off together, by 5 sigma of one.",
        "The first line names the angle and its rows; no contradiction, and no other cause.",
        fitted(_one_angle_off(), fix={}),
        _looks(
            "repeats", "the 5 repeats of beta at 40 degrees are off together", "--exclude 17 --exclude 18"
        ),
    ),
    _case(
        "two readings of each impact",
        "30 impacts, each read from the film two times, as 60 rows.",
        "The first line says that readings of one impact are no repeats, and what column tells so; the law "
        "is not contradicted.",
        fitted(_read_repeatedly(), fix={}),
        _looks("repeats", "Repeated readings of one impact", "impact_id"),
    ),
    _case(
        "a wall that wears",
        "40 impacts in no order of the angle, while mu rises from 0.10 to 0.16.",
        "A drift of mu along the table, with both of its ends; no impacts of two kinds.",
        fitted(_wearing()),
        _looks("slips", "a drift of mu along it, from 0.", "look for wear", "--separate mu"),
    ),
    _case(
        "filmed velocities",
        "beta whose errors grow as 1/sin gamma, and no sigma.",
        "The scatter is said to grow towards normal incidence, as errors of velocities would; no row is to "
        "be left out.",
        fitted(_filmed()),
        _looks("growing_scatter", "grows towards normal incidence", "--sigma-velocity"),
    ),
    _case(
        "angles that were read with errors",
        "60 beta of noise 0.01, each at an angle that was read 1.3 degrees off, give or take, and no sigma.",
        "The scatter is said to be that of the angles, with its size and the options that count it; nothing "
        "looks left out, mixed or outlying.",
        fitted(_misread()),
        _misread_angles,
    ),
    _case(
        "a third of a column in percent",
        "beta as a fraction in two rows, in percent in the next, and so on.",
        "The first line names the rows in percent.",
        fitted(_partly_in_percent()),
        _looks("slips", "beta in percent in some of its lines (2, 5, 8", "by 100"),
    ),
)
