"""What a user registers is known everywhere: in fits, predictions, comparisons, reports, scenes and costs."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from extensions.closure import GRIP
from extensions.effect import BRAKE_SHARE, Brake
from extensions.observable import SPIN_GAINED
from factories import impacts_file, rest_long
from refusals import refused
from scipy.stats import kstest
from toys import BEND, HALF_DROP, TILT, Rooted

import ifrfit
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.estimators import ESTIMATORS
from ifrfit.inference.model.error_law import ERROR_LAWS
from ifrfit.physics import CLOSURES, Closure
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closure import rotational_share
from ifrfit.physics.effects import EFFECTS
from ifrfit.physics.impulse_laws import friction_factor
from ifrfit.registry import registered
from ifrfit.report.page.explorer import payload, reason_without_panel
from ifrfit.report.page.html import panel_script
from ifrfit.report.page.plugins import GENERATOR
from ifrfit.report.page.writing import check_format

GAMMA = np.linspace(4.0, 80.0, 20)
TRUTH = {"g_rip": 0.7, "eta": 0.6}
SCENE = """
observables = {observables}
[sphere]
diameter_mm = 5
material = "alumina"
[wall]
material = "soda-lime-glass"
[impact]
gamma_deg = {{ from = 5, to = 80, count = 6 }}
speed_m_s = 3.9
[constants]
{constants}
"""

pytestmark = pytest.mark.usefixtures("toys")


def table(
    folder: Path, closure: Closure, observable: str = "beta", noise: float = 0.01, every: int = 1
) -> Path:
    """Impacts of a closure with known constants."""
    made = {"closure": closure.name, "e_n": 0.9, "mu": 0.12, "c": TRUTH.get(closure.constant or "", 0.0)}
    seen = {"gamma": GAMMA[::every], "observables": (observable,), "noise": noise, "sigma": noise, "seed": 1}
    return impacts_file(folder / f"{closure.name}-{observable}.csv", made | seen)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("toys")


@pytest.fixture(scope="module")
def fits(folder: Path, toys: None) -> dict[str, Any]:
    """An exact fit by each toy closure to its own impacts."""
    return {
        closure.name: ifrfit.fit(table(folder, closure), closure=closure.name, fix={"e_n": 0.9})
        for closure in (GRIP, BEND)
    }


# ---- closures


@pytest.mark.parametrize("method", tuple(ESTIMATORS))
def test_a_closure_with_a_new_constant_is_fitted_by_every_method(folder: Path, method: str) -> None:
    found = ifrfit.fit(table(folder, GRIP), closure="grip", method=method, fix={"e_n": 0.9})
    estimate = found.constants["g_rip"]
    assert estimate.status == "determined"
    assert estimate.interval95[0] < 0.7 < estimate.interval95[1]
    sticking = found.derived["beta_sticking"]
    assert sticking.value == pytest.approx(2.0 * estimate.value - 1.0)


def test_a_law_that_is_not_bilinear_is_fitted(fits: dict[str, Any]) -> None:
    found = fits["bend"]
    low, high = found.constants["eta"].interval95
    assert low < 0.6 < high
    assert "beta_sticking" not in found.derived  # the closure does not say what eta stands for


@pytest.mark.parametrize(
    ("observables", "gamma", "share", "most_mu"),
    [
        # rounding leaves a curvature below 0
        (("beta", "v_x"), np.linspace(4.0, 60.0, 13), 0.3, 0.6),
        # the bound of mu leaves the constant a range without width
        (("beta",), np.linspace(4.0, 80.0, 20), 0.4, 2.0),
    ],
)
def test_a_constant_that_takes_no_part_in_sticking_is_integrated(
    folder: Path, observables: tuple[str, ...], gamma: Any, share: float, most_mu: float
) -> None:
    """Posterior against the density summed over a fine grid of the constant and mu."""
    made = {"gamma": gamma, "e_n": 0.9, "c": share, "sigma": 0.05, "noise": 0.05}
    path = impacts_file(
        folder / "lock.csv", {**made, "closure": "lock", "observables": observables, "seed": 1}
    )
    found = ifrfit.fit(path, closure="lock", fix={"e_n": 0.9}, noise="known", bounds={"mu": (0.0, most_mu)})
    middle = (np.arange(240) + 0.5) / 240
    c, mu = np.meshgrid(0.9 * middle, 0.6 * middle, indexing="ij")
    z = standardised(found, np.column_stack((np.full(c.size, 0.9), c.ravel(), mu.ravel())))
    assert_moments(found, {"lock": c.ravel(), "mu": mu.ravel()}, -0.5 * (z**2).sum(axis=1), 5e-3)


def standardised(found: ifrfit.FitResult, theta: Any) -> Any:
    """Residuals over sigma at many constants."""
    problem = found.problem
    assert problem is not None
    return (problem.rows.value - problem.predict(theta)) / 0.05


def assert_moments(found: Any, grids: dict[str, Any], log_density: Any, tolerance: float) -> None:
    """Mean and sd of the posterior are those of the density summed over a grid."""
    weight = np.exp(log_density - log_density.max())
    for name, grid in grids.items():
        mean = float(grid @ weight / weight.sum())
        sd = float(np.sqrt((grid - mean) ** 2 @ weight / weight.sum()))
        assert found.distribution.mean(name) == pytest.approx(mean, abs=tolerance * sd)
        assert found.distribution.sd(name) == pytest.approx(sd, rel=tolerance)


@pytest.mark.parametrize("name", ["grip", "bend"])
def test_predictions_follow_the_closure(fits: dict[str, Any], name: str) -> None:
    found = fits[name]
    own = {key: found.constants[key].value for key in TRUTH if key in found.constants}
    state = ifrfit.rebound(
        [10.0, 70.0], e_n=0.9, mu=found.constants["mu"].value, closure=name, degrees=True, **own
    )
    np.testing.assert_allclose(found.predict([10.0, 70.0])["value"], state.beta, atol=0.01)


def test_tables_write_the_constant_in_latex(fits: dict[str, Any]) -> None:
    assert r"$\Gamma$ & $0.70" in fits["grip"].summary(style="latex")
    assert r"$\eta$ & $0.6" in fits["bend"].summary(style="latex")


def test_all_closures_are_compared(folder: Path) -> None:
    found = ifrfit.compare(table(folder, GRIP), fix={"e_n": 0.9}, noise="known", loo=False)
    assert list(found.entries) == list(CLOSURES)
    assert found.entries["grip"].probability > found.entries["f"].probability
    assert "GRIP" in found.summary()
    assert "BEND" in found.summary()


@pytest.mark.parametrize(("name", "constant"), [("grip", "g_rip"), ("bend", "eta")])
def test_a_scene_takes_the_closure(fits: dict[str, Any], folder: Path, name: str, constant: str) -> None:
    scene = folder / f"{name}.toml"
    lines = f'closure = "{name}"\ne_n = 0.9\nmu = 0.12\n{constant} = {TRUTH[constant]}'
    scene.write_text(SCENE.format(observables=["beta"], constants=lines), encoding="utf-8")
    found = ifrfit.simulate(scene)
    own = {constant: TRUTH[constant]}
    gamma = np.linspace(5.0, 80.0, 6)
    state = ifrfit.rebound(gamma, e_n=0.9, mu=0.12, closure=name, degrees=True, **own)
    np.testing.assert_allclose(found.rebounds()["value"], state.beta, atol=2e-3)
    fits[name].save(folder / f"{name}-fit.json")
    scene.write_text(
        SCENE.format(observables=["beta"], constants=f'result = "{name}-fit.json"'), encoding="utf-8"
    )
    assert ifrfit.simulate(scene, samples=5).closure == name
    scene.write_text(
        SCENE.format(
            observables=["beta"], constants='closure = "f"\nmu = 0.1\ne_n = 0.9\n' + f"{constant} = 0.5"
        )
    )
    with refused(DataError, match=f"closure F has no {constant}; it takes e_n, mu"):
        ifrfit.simulate(scene)


@pytest.mark.usefixtures("brief_costs")
def test_costs_name_every_closure(folder: Path) -> None:
    found = ifrfit.measure_costs(
        table(folder, GRIP), closure="grip", fix={"e_n": 0.9}, kinds="physics", quick=True
    )
    methods = {cost.method for cost in found.costs}
    assert {f"closure {c.title}" for c in CLOSURES.values() if c.name != "maw"} | {"table"} <= methods
    best = {cost.method: cost.error for cost in found.costs}
    assert best["closure GRIP"] < 1.0


# ---- every closure of the registry through every command


def through_every_command(
    cli: Callable[..., str], folder: Path, options: tuple[str, ...], page: str = "page.html"
) -> dict[str, Any]:
    """The content of result.json, after predictions, a report, a simulation and costs from it."""
    data, result = table(folder, GRIP, every=2), folder / "result.json"
    chosen = ("--fix", "e_n=0.9", *options)
    result.write_text(cli("fit", data, *chosen, "--json"), encoding="utf-8")
    assert "beta" in cli("predict", result, "--gamma", "10,40,70")
    cli("report", result, "--out", folder / page)
    scene = folder / "scene.toml"
    scene.write_text(SCENE.format(observables=["beta"], constants='result = "result.json"'))
    cli("simulate", scene, "--out", folder / "simulated")
    return dict(json.loads(result.read_text(encoding="utf-8")))


def costs(cli: Callable[..., str], folder: Path, options: tuple[str, ...]) -> set[str]:
    """The methods whose costs are measured."""
    measured = cli(
        "cost", table(folder, GRIP, every=2), *options, "--fix", "e_n=0.9",
        "--kind", "inference", "--quick", "--json",
    )  # fmt: skip
    return {cost["method"] for cost in json.loads(measured)["costs"]}


@pytest.mark.parametrize("name", rest_long(("grip", "bend", "maw", *(x for x in CLOSURES if x != "maw")), 2))
def test_every_closure_goes_through_every_command(cli: Callable[..., str], tmp_path: Path, name: str) -> None:
    chosen = ("--closure", name)
    content = through_every_command(cli, tmp_path, (*chosen, "--method", "lsq"))
    assert list(content["constants"]) == list(CLOSURES[name].constants)
    assert f"closure {CLOSURES[name].title}" in (tmp_path / "page.html").read_text(encoding="utf-8")
    others = (*chosen, "--closure", "ifr" if name != "ifr" else "fr", "--fix", "e_n=0.9", "--no-loo")
    found = cli("compare", table(tmp_path, GRIP, every=2), *others, "--json")
    assert name in json.loads(found)["closures"]


@pytest.mark.usefixtures("brief_costs")
@pytest.mark.parametrize("name", rest_long(("grip", "bend", "maw")))
def test_inference_with_closures_of_every_kind_has_costs(
    cli: Callable[..., str], tmp_path: Path, name: str
) -> None:
    """Laws that are bilinear with a new constant, that are not, and that need a material."""
    assert {"lsq", "exact"} <= costs(cli, tmp_path, ("--closure", name))


# ---- observables


@pytest.mark.parametrize("observable", [SPIN_GAINED, TILT, HALF_DROP])
def test_an_observable_is_read_and_fitted(folder: Path, observable: Any) -> None:
    path = table(folder, CLOSURES["f"], observable.name, 0.05 if observable.unit == "deg" else 0.002)
    free = observable.kind == "normal"
    for method in ("lsq", "exact"):
        found = ifrfit.fit(path, closure="f", method=method, fix={"mu": 0.12} if free else {"e_n": 0.9})
        name, truth = ("e_n", 0.9) if free else ("mu", 0.12)
        low, high = found.constants[name].interval95
        assert low < truth < high
        assert high - low < 0.1
    assert observable.meaning in found.summary() or observable.name in found.summary()


def test_an_observable_beyond_its_range_is_refused(folder: Path) -> None:
    path = folder / "wrong.csv"
    path.write_text("gamma_deg,observable,value\n10,tilt_deg,91\n20,half_v_n,0.2\n")
    with refused(DataError, match=r"91 degrees is impossible for tilt_deg \(-90 to 90 degrees\)"):
        ifrfit.read(path)


def test_a_scene_takes_the_observables(folder: Path) -> None:
    scene = folder / "observables.toml"
    names = ["spin_gained", "tilt_deg", "half_v_n"]
    scene.write_text(SCENE.format(observables=names, constants="e_n = 0.9\nmu = 0.1\ne_t = -0.9"))
    found = ifrfit.simulate(scene)
    assert list(dict.fromkeys(found.rebounds()["observable"])) == names
    assert np.isfinite(found.rebounds()["value"]).all()


def test_errors_of_spins_reach_a_new_observable(folder: Path) -> None:
    path = table(folder, CLOSURES["f"], "spin_gained", 0.01)
    found = ifrfit.fit(
        path,
        closure="f",
        fix={"e_n": 0.9},
        method="lsq",
        noise=ifrfit.Noise(sigma_velocity=0.01, sigma_spin=0.03),
    )
    assert set(found.points["sigma"].round(12)) == {0.03}


def test_the_page_has_a_panel_where_there_is_an_expression(folder: Path) -> None:
    for observable, there in ((SPIN_GAINED, True), (TILT, False)):
        path = table(folder, CLOSURES["f"], observable.name, 0.01)
        found = ifrfit.fit(path, closure="f", fix={"e_n": 0.9}, method="lsq")
        why = "The panel has no formula for tilt_deg: the picture above stands alone."
        assert reason_without_panel(found) == ("" if there else why)
    assert "spin_gained: (r) => r.spinY - r.i.spinY," in panel_script()
    assert "tilt_deg: (r)" not in panel_script()


def test_the_panel_leaves_out_what_has_no_expression(folder: Path) -> None:
    paths = [table(folder, CLOSURES["f"], each.name, 0.01) for each in (SPIN_GAINED, TILT)]
    found = ifrfit.fit(paths, closure="f", fix={"e_n": 0.9}, method="lsq")
    content = payload(found)
    assert [each["name"] for each in content["observables"]] == ["spin_gained"]
    assert content["left_out"] == ["tilt_deg"]
    assert len(content["rows"]["value"]) == GAMMA.size


# ---- effects


def test_an_effect_joins_the_plan(folder: Path) -> None:
    scene = folder / "brake.toml"
    text = SCENE.format(observables=["e_n"], constants="e_n = 0.9\nmu = 0.1\ne_t = -0.9")
    scene.write_text(text)
    found = ifrfit.simulate(scene)
    line = next(line for line in found.plan.lines if line.effect == "brake")
    assert (line.state, line.reason) == ("unknown", "not given: contact.brake_share")
    np.testing.assert_allclose(found.rebounds()["value"], 0.9, atol=0.01)
    scene.write_text(text + "[contact]\nbrake_share = 0.5\n")
    found = ifrfit.simulate(scene)
    line = next(line for line in found.plan.lines if line.effect == "brake")
    assert line.state == "on"
    assert line.change == pytest.approx(0.45, abs=0.01)
    assert [each.effect for each in found.plan.lines] == list(EFFECTS)
    np.testing.assert_allclose(found.rebounds()["value"], 0.45, atol=0.01)
    assert "brake" in found.summary()
    scene.write_text(text + "[contact]\nbrake_share = 2\n")
    with refused(DataError, match=r"contact\.brake_share: 2 is impossible \(0 to 1 in SI units\)"):
        ifrfit.simulate(scene)


# ---- methods, sections, formats


@pytest.mark.usefixtures("brief_costs")
def test_a_method_goes_through_every_command(cli: Callable[..., str], tmp_path: Path) -> None:
    content = through_every_command(cli, tmp_path, ("--closure", "grip", "--method", "mode"), "page.toc")
    assert content["method"] == "mode"
    assert "It waited 3." in content["warnings"]
    assert "posterior mode" in ifrfit.load_result(tmp_path / "result.json").summary()
    headings = (tmp_path / "page.toc").read_text(encoding="utf-8").splitlines()
    assert headings[0] == GENERATOR
    assert "How many" in headings
    assert "mode" in costs(cli, tmp_path, ("--closure", "grip"))


def test_refusals_list_what_is_registered(folder: Path) -> None:
    data = table(folder, GRIP)
    with refused(UsageError, match=r"no closure 'x'\. Choose one of .*, grip, bend"):
        ifrfit.fit(data, closure="x")
    with refused(UsageError, match=r"--tails x: choose gaussian or .*logistic"):
        ifrfit.fit(data, noise=ifrfit.Noise(tails="x"))
    with refused(UsageError, match=r"--format x: a report is html, .*toc; choose one of them"):
        check_format("x", "--format x")


# ---- laws of errors


@pytest.mark.usefixtures("brief_costs")
def test_a_law_of_errors_goes_through_every_command(cli: Callable[..., str], tmp_path: Path) -> None:
    chosen = ("--closure", "grip", "--tails", "logistic")
    content = through_every_command(cli, tmp_path, chosen)
    assert (content["method"], content["noise"]["scatter"]["tails"]) == ("exact", "logistic")
    assert "logistic errors" in ifrfit.load_result(tmp_path / "result.json").summary()
    data = table(tmp_path, GRIP, every=2)
    least = json.loads(cli("fit", data, *chosen, "--fix", "e_n=0.9", "--method", "lsq", "--json"))
    assert least["noise"]["scatter"]["tails"] == "logistic"
    others = (*chosen, "--closure", "f", "--fix", "e_n=0.9", "--no-loo")
    assert "grip" in json.loads(cli("compare", data, *others, "--json"))["closures"]
    assert costs(cli, tmp_path, chosen)


def test_a_law_of_errors_gives_the_posterior_of_its_density(folder: Path) -> None:
    """One free constant: the posterior by summing the density over a fine grid."""
    path = table(folder, GRIP, noise=0.05)
    found = ifrfit.fit(
        path, closure="grip", fix={"e_n": 0.9, "mu": 0.12}, noise=ifrfit.Noise("known", tails="logistic")
    )
    grid = np.linspace(0.3, 1.0, 4001)
    z = standardised(found, np.column_stack((0.9 + 0 * grid, grid, 0.12 + 0 * grid)))
    log_density = (-np.abs(z) - 2.0 * np.log1p(np.exp(-np.abs(z)))).sum(axis=1)
    assert_moments(found, {"g_rip": grid}, log_density, 2e-3)


@pytest.mark.parametrize("name", [*ERROR_LAWS, "logistic"])
def test_a_law_of_errors_does_not_contradict_itself(name: str) -> None:
    law, dof = ERROR_LAWS[name], ERROR_LAWS[name].default_dof
    z, step = np.linspace(-60.0, 60.0, 240_001), 1e-4
    density = np.exp(law.log_density(z, dof))
    assert np.trapezoid(density, z) == pytest.approx(1.0, abs=1e-5)
    slope = (law.log_density(z + step, dof) - law.log_density(z - step, dof)) / (2.0 * step)
    np.testing.assert_allclose(-slope, law.weight(z, dof) * z, atol=1e-6)
    assert np.trapezoid(slope**2 * density, z) == pytest.approx(law.information(dof), abs=1e-4)
    near = z[np.abs(z) < 8.0]
    rise = (law.cdf(near + step, dof) - law.cdf(near - step, dof)) / (2.0 * step)
    np.testing.assert_allclose(rise, np.exp(law.log_density(near, dof)), atol=1e-6)
    drawn = law.draw(np.random.default_rng(1), (20_000,), dof)
    assert kstest(drawn, lambda x: law.cdf(x, dof)).pvalue > 1e-3


# ---- what is refused, and what stays


def _over_cosine(i: Incidence, j: float) -> tuple[Any, Any]:
    return i.sine / i.cosine, -i.slip_x / i.cosine


GRAZING = {"value": lambda r, mu: r.v_x / r.incidence.cosine, "linear": _over_cosine}
SILENT = GRAZING | {
    "value": lambda r, mu: np.where(r.incidence.cosine == 0.0, np.nan, r.v_x / r.incidence.cosine)
}


def rooted(base: type[Rooted] = Rooted, **functions: Any) -> Closure:
    """Closure BEND, and functions of its law replaced."""
    law = dataclass(frozen=True)(type("Broken", (base,), functions))
    return replace(BEND, name="b2", law=lambda j: law(rotational_share(j)))


class HastyBound(Rooted):
    """The slope of the bound is wrong, and that of the impulse is not."""

    def bound_slope(self, c: Any) -> Any:
        return self.share * np.asarray(c)

    def slopes(self, incidence: Any, c: Any, kappa: Any) -> Any:
        return Rooted(self.share).slopes(incidence, c, kappa)


def late_to_stick(root: Rooted, incidence: Incidence, c: Any, kappa: Any) -> Any:
    k, _ = Rooted(root.share).impulse(incidence, c, kappa)
    return k, 0.9 * friction_factor(incidence, kappa) >= root.bound(c)


def without_friction(root: Rooted, incidence: Incidence, c: Any, kappa: Any) -> Any:
    by_c, by_kappa = Rooted(root.share).slopes(incidence, c, kappa)
    return by_c, 0.0 * by_kappa


def undefined(root: Rooted, incidence: Incidence, c: Any, kappa: Any) -> Any:
    by_c, by_kappa = Rooted(root.share).slopes(incidence, c, kappa)
    return np.nan * by_c, by_kappa


def flat(endless: float) -> Closure:
    """A bound that does not depend on the constant, and the constant above it."""
    return rooted(
        bound=lambda root, c: root.share + 0.0 * np.asarray(c),
        bound_slope=lambda root, c: 0.0 * np.asarray(c),
        constant_at=lambda root, bound: np.copysign(endless, np.asarray(bound) - root.share),
    )


def test_a_law_that_does_not_contradict_itself_is_taken() -> None:
    """Control: what the refused ones are made from, and a bound that does not depend on the constant."""
    for entry in (rooted(), flat(np.inf)):
        with registered(entry):
            assert CLOSURES["b2"] is entry


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        (
            replace(GRIP, name="g2", own=replace(GRIP.own, domain=lambda j: (0.0, 1.2))),
            r"Closure GRIP creates kinetic energy with g_rip = 1\.2, inertia factor 0\.4: the contact point "
            r"leaves with 1\.4 times its velocity\.",
        ),
        (replace(GRIP, name="g2", own=replace(GRIP.own, name="mu")), "calls its constant 'mu'"),
        (replace(GRIP, name="g2", own=replace(GRIP.own, name="a b")), "calls its constant 'a b'"),
        (
            replace(GRIP, name="g2", law=lambda j: 3.0),
            r"is a float: it must have the functions of .*Law, and lacks impulse, slopes, .* constant_at\.",
        ),
        (rooted(bound_slope=None), "and lacks bound_slope"),
        (
            rooted(impulse=late_to_stick),
            r"with inertia factor 0\.4: it sticks elsewhere than where kappa/tau",
        ),
        (rooted(slopes=lambda root, i, c, kappa: (c, kappa)), "slopes by eta are not those of impulse"),
        (rooted(slopes=without_friction), "slopes by kappa are not those of impulse"),
        (rooted(slopes=undefined), "slopes by eta are not those of impulse"),
        (rooted(HastyBound), "bound_slope is not that of bound"),
        (rooted(constant_at=lambda root, bound: bound), r"constant_at\(bound\(eta\)\) is not eta"),
        (flat(0.0), "bound does not depend on eta: constant_at must be inf above it, -inf below"),
        (replace(TILT, name="tilt"), "end with _deg where its unit is deg"),
        (replace(SPIN_GAINED, name="s2", takes=frozenset({"Q"})), "takes Q: known are Tx, Ty, Sx, Sy, N"),
        (replace(SPIN_GAINED, name="s2", linear=None), "lacks the form of that kind"),
        (replace(SPIN_GAINED, name="s2", linear=lambda i, j: (i.sine, -i.slip_x / j)), "differ by up to"),
        (replace(HALF_DROP, name="s2", high=0.1), "outside its range"),
        (replace(SPIN_GAINED, name="s2", panel="'</script>'"), "would end the page's script"),
        (replace(SPIN_GAINED, name="s2", **GRAZING), "s2 is inf at gamma = 90 degrees: let it be nan"),
        (replace(SPIN_GAINED, name="s2", **SILENT), "s2 is nan at gamma = 90 degrees.* by grazing"),
        (Brake(name="b2", stage="later"), "has the stage 'later': take plane, normal, "),
        (Brake(name="b2", numbers=(replace(BRAKE_SHARE, unit="furlong"),)), "no unit 'furlong'"),
        (Brake(name="b2", numbers=(replace(BRAKE_SHARE, high=2.0),)), "effect brake describes otherwise"),
        (replace(GRIP, name="ifr"), "There is a closure 'ifr' already"),
    ],
)
def test_an_entry_that_contradicts_itself_is_refused(entry: Any, words: str) -> None:
    with refused(UsageError, match=words):
        ifrfit.register(entry)


def test_nothing_stays_behind() -> None:
    extra = replace(GRIP, name="for-a-while")
    with registered(extra):
        assert CLOSURES["for-a-while"] is extra
    assert "for-a-while" not in CLOSURES
