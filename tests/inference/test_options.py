"""Models, noises and methods as objects, and the keywords and command lines that stand for them."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, fields, replace
from fractions import Fraction

import emcee
import numpy as np
import pytest
from click.testing import CliRunner
from extensions.method import Mode
from refusals import refused
from scipy import special

import ifrfit
from ifrfit import (
    MCMC,
    AngleErrors,
    Automatic,
    Bootstrap,
    Exact,
    LeastSquares,
    Model,
    Noise,
    Profile,
    UsageError,
)
from ifrfit.cli.main import app
from ifrfit.inference import keywords as typed
from ifrfit.inference.estimator import Estimator
from ifrfit.inference.estimators import label_of, make_estimator, title_of
from ifrfit.inference.keywords import estimator_of, model_of
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.option_fields import build, option, options_of
from ifrfit.registry import registered

GAMMA = np.linspace(4.0, 86.0, 34)
# what an option of the command line is in the classes
VALUES = {
    "tails": ("student-t", Noise(tails="student-t")),
    "dof": (3.0, Noise(tails="student-t", dof=3.0)),
    "angle_errors": ("set", Noise(angles=AngleErrors("set"))),
    "angle_population": ((5.0, 80.0), Noise(angles=AngleErrors("measured", population=(5.0, 80.0)))),
    "sigma_gamma": (1.0, Noise(angles=AngleErrors("set", sigma_deg=1.0))),
    "angle_offset": (1.0, Noise(angles=AngleErrors(offset_sd=1.0))),
    "sigma_velocity": (0.02, Noise(sigma_velocity=0.02)),
    "sigma_spin": (0.03, Noise(sigma_velocity=0.02, sigma_spin=0.03)),
    "common_errors": ("ignored", Noise(common_errors="ignored")),
    "accuracy": (1e-2, Exact(accuracy=1e-2)),
    "budget": ("2s", Exact(budget="2s")),
    "integrator": ("sampling", Exact(integrator="sampling")),
    "max_steps": (50, MCMC(max_steps=50)),
    "resume": ("here", MCMC(resume="here")),
    "workers": (2, MCMC(workers=2)),
    "scheduler": ("tcp://127.0.0.1:8786", Exact(scheduler="tcp://127.0.0.1:8786")),
    "resample": ("wild", Bootstrap("wild")),
    "replicates": (200, Bootstrap(replicates=200)),
}
BESIDE = {
    "dof": {"tails": "student-t"},
    "angle_population": {"angle_errors": "measured"},
    "sigma_gamma": {"angle_errors": "set"},
    "sigma_spin": {"sigma_velocity": 0.02},
}


@pytest.mark.parametrize("keyword", VALUES)
def test_an_option_makes_the_object_that_it_stands_for(keyword):
    value, made = VALUES[keyword]
    given = {keyword: value, **BESIDE.get(keyword, {})}
    if isinstance(made, Noise):
        assert build(Noise, given) == made
    else:
        assert make_estimator(made.name, given) == made


def test_every_option_of_noise_and_methods_is_tried_here():
    own = (Noise, Exact, LeastSquares, Profile, MCMC, Bootstrap)
    assert set(VALUES) == {name for kind in own for name in options_of(kind)} - {"noise"}


def test_the_keywords_of_the_types_are_those_of_the_classes():
    """Type checkers need the names written out."""
    of_model = set(typed.ConstantKeywords.__annotations__) - {"params"}
    assert of_model == set(options_of(Model)) - {"closure"}


def test_a_keyword_that_does_not_exist_is_an_error_of_python():
    with pytest.raises(TypeError, match=r"fit\(\) got an unexpected keyword argument 'colour'"):
        ifrfit.fit("cross-2019", colour="red")
    with pytest.raises(TypeError, match=r"compare\(\) got an unexpected keyword argument 'max_steps'"):
        ifrfit.compare("cross-2019", max_steps=3)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: model_of(Model(), {"fix": {"e_n": 0.9}}), r"model=Model\(\.\.\.\) and fix both say"),
        (lambda: model_of(Model(), {"params": object()}), "and params both say"),
        (lambda: model_of(Model("fr"), {"closure": "f"}), "and closure both say"),
        (lambda: estimator_of(Exact), r"is no method\. Give a name, or an object as ifrfit\.Exact\(\)"),
    ],
)
def test_an_object_and_a_keyword_cannot_both_say_something(call, says):
    with refused(UsageError, match=says):
        call()


def test_a_keyword_that_says_what_holds_anyway_is_no_contradiction():
    assert model_of(Model("fr"), {"fix": None, "separate": (), "closure": "ifr"}) == Model("fr")
    assert build(Noise, {"noise": "known", "tails": "gaussian", "angle_errors": "none"}) == Noise("known")
    assert make_estimator("profile", {"workers": 1, "accuracy": None}) == Profile()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Model(inertia_factor=-1.0), "--inertia-factor -1: it must be positive"),
        (lambda: Noise("loud"), "--noise loud: choose known, scaled, unknown or mixed"),
        (lambda: Exact(accuracy=7.0), "--accuracy 7: choose from 1e-9 to 0.5"),
        (lambda: Exact(budget="soon"), "--budget soon: write a time"),
        (lambda: MCMC(max_steps=0), "--max-steps 0: it must be 1 or more"),
        (lambda: MCMC(max_steps=100, accuracy=0.1), "pick the settings themselves: leave --max-steps out"),
        (lambda: MCMC(workers=0), "--workers 0: it must be 1 or more"),
        (lambda: Bootstrap(workers=0), "--workers 0: it must be"),
        (lambda: make_estimator("lsq", {"accuracy": 0.1}), "--accuracy belongs to --method exact or mcmc"),
        (
            lambda: make_estimator("profile", {"max_steps": 2}),
            "--max-steps belongs to --method mcmc",
        ),
    ],
)
def test_a_wrong_combination_cannot_be_made(make, says):
    with refused(UsageError, match=says):
        make()


def test_objects_show_what_differs_from_the_defaults():
    assert repr(Model("fr", fix={"e_n": 0.9})) == "Model(closure='fr', fix={'e_n': 0.9})"
    assert repr(Noise(angles=AngleErrors("set", sigma_deg=1.0))) == (
        "Noise(angles=AngleErrors(kind='set', sigma_deg=1.0))"
    )
    assert repr(MCMC(max_steps=40)) == "MCMC(max_steps=40)"
    assert repr(LeastSquares()) == "LeastSquares()"


def test_a_model_keeps_its_own_copy():
    fix = {"e_n": 0.9}
    model = Model(fix=fix, separate="mu")
    fix["mu"] = 0.1
    assert model.fix == {"e_n": 0.9}
    assert model.separate == ("mu",)
    with pytest.raises(AttributeError, match="cannot assign to field 'closure'"):
        model.closure = "fr"


def test_the_noise_is_the_error_model_of_its_choices():
    noise = Noise("scaled", tails="student-t", angles=AngleErrors("set", sigma_deg=1.0))
    assert noise.error_model == ErrorModel(tails="student-t", angles="set", gamma=1.0)
    assert noise.with_gaussian_values() == Noise("scaled")


def test_no_method_and_an_accuracy_pick_one():
    assert make_estimator(None, {}) == Exact()
    assert make_estimator(None, {"accuracy": 1e-3}) == Automatic(1e-3)
    assert make_estimator(None, {"budget": "2s", "workers": 2}) == Automatic(budget="2s", workers=2)
    assert make_estimator("exact", {"accuracy": 1e-3}) == Exact(1e-3)


def test_objects_and_keywords_are_the_same_question(impacts):
    path = impacts(gamma=GAMMA, observables=("beta", "e_n"), noise=0.03, sigma=0.03, c=-0.8, seed=1)
    model = Model("fr", prior={"e_n": (0.94, 0.02)}, bounds={"mu": (0.0, 0.5)}, inertia_factor=0.4)
    by_object = ifrfit.fit(path, model, noise=Noise("scaled"), method=LeastSquares(), seed=2)
    by_keyword = ifrfit.fit(
        path,
        closure="fr",
        prior={"e_n": (0.94, 0.02)},
        bounds={"mu": (0.0, 0.5)},
        inertia_factor=0.4,
        noise="scaled",
        method="lsq",
        seed=2,
    )
    assert by_object.problem.digest == by_keyword.problem.digest
    assert by_object.constants == by_keyword.constants


def test_a_comparison_takes_the_same_objects(impacts):
    path = impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8, seed=1)
    model, noise = Model(fix={"e_n": 0.94, "e_t": -0.8}), Noise("scaled")
    found = ifrfit.compare(path, ["ifr", "f"], model=model, noise=noise, loo=False)
    assert found.notes[0] == "--fix e_t holds for IFR; F has no such constant."
    own = ifrfit.fit(path, replace(model, closure="ifr"), noise=noise)
    assert found.entries["ifr"].fit.constants == own.constants
    assert found.entries["f"].fit.problem.parameters["e_n"].fixed == 0.94


def test_a_problem_for_another_closure_keeps_what_was_said_of_its_constants():
    model = Model(fix={"e_n": 0.94}, prior={"e_t": (-0.9, 0.1)}, bounds={"mu": (0.0, 0.5)})
    problem = ifrfit.fit("cross-2019", model, method="lsq").problem
    other = problem.with_closure(ifrfit.fit("cross-2019", closure="maw", method="lsq").problem.closure)
    assert [each.name for each in other.parameters] == ["e_n", "chi", "mu"]
    assert other.parameters["e_n"].fixed == 0.94
    assert (other.parameters["mu"].lower, other.parameters["mu"].upper) == (0.0, 0.5)
    assert other.with_closure(problem.closure).parameters["e_t"].prior is None
    again = problem.with_closure(problem.closure)
    assert again.digest == problem.digest


@pytest.fixture
def mode():
    with registered(Mode()):
        yield Mode


def run(*arguments):
    return CliRunner().invoke(app, list(arguments), prog_name="ifrfit", env={"COLUMNS": "100"})


def test_a_method_plugs_in(mode):
    assert isinstance(Mode(), Estimator)
    found = ifrfit.fit("cross-2019", method=Mode(5), fix={"e_n": 0.94})
    assert found.method == "mode"
    assert "It waited 5." in found.warnings
    assert found.constants == ifrfit.fit("cross-2019", method="lsq", fix={"e_n": 0.94}).constants
    assert "posterior mode" in found.summary()
    assert (title_of("mode"), label_of("mode")) == ("posterior mode", "mode")
    with refused(UsageError, match="mode: plain errors only"):
        ifrfit.fit("cross-2019", method="mode", noise=Noise(tails="student-t"))


def test_a_method_and_its_options_are_on_the_command_line(mode):
    help_text = run("fit", "--help").stdout
    assert "mode: the optimum alone." in help_text
    assert "--patience N" in help_text
    found = run("fit", "cross-2019", "--fix", "e_n=0.94", "--method", "mode", "--patience", "7")
    assert (found.exit_code, found.stderr) == (0, "")
    assert "It waited 7." in found.stdout
    found = run("fit", "cross-2019", "--patience", "7")
    assert found.exit_code == 2
    assert "--patience belongs to --method mode, not to --method exact." in found.stderr


def test_a_method_that_is_gone_is_unknown():
    assert title_of("mode") == "mode"
    assert "--patience" not in run("fit", "--help").stdout
    with refused(UsageError, match="There is no method 'mode'"):
        ifrfit.fit("cross-2019", method="mode")


def test_an_option_of_a_class_is_in_fit_compare_and_cost_by_itself(monkeypatch):
    @dataclass(frozen=True, repr=False)
    class Louder(Noise):
        volume: float | None = option(None, "How loud it is.", form="number", metavar="DB")

    monkeypatch.setattr("ifrfit.inference.options.Noise", Louder)
    for command in ("fit", "compare", "cost"):
        text = run(command, "--help").stdout
        assert "--volume DB" in text
        assert "How loud it is." in text


@pytest.mark.parametrize("owner", [Model, Noise, AngleErrors, Exact, MCMC, Bootstrap, Automatic])
def test_every_field_is_an_option_with_help_and_is_described(owner):
    options = options_of(owner)
    assert all(each.help for each in options.values())
    text = inspect.getdoc(owner).partition("Attributes")[2]
    assert all(each.name in text for each in fields(owner))
    assert build(owner, {}) == owner()


def test_who_brings_a_sampler_finds_the_density_and_the_predictions():
    """emcee on `fit.problem`, against the quadrature."""
    fit = ifrfit.fit("cross-2019", Model(fix={"e_n": 0.94}), noise="known")
    problem = fit.problem
    free = problem.parameters.free

    def log_posterior(values):
        theta = np.empty(free.size)
        theta[free], theta[~free] = values, 0.94
        return problem.log_posterior(theta)

    names = [name for name, is_free in zip(problem.parameters.names, free, strict=True) if is_free]
    middle = np.array([fit.constants[name].value for name in names])
    spread = np.array([fit.constants[name].stderr for name in names])
    rng = np.random.RandomState(1)
    sampler = emcee.EnsembleSampler(16, middle.size, log_posterior)
    sampler.random_state = rng.get_state()
    sampler.run_mcmc(middle + 0.5 * spread * rng.standard_normal((16, middle.size)), 400)
    draws = sampler.get_chain(discard=100, flat=True)
    assert np.abs(draws.mean(axis=0) - middle).max() < 0.3 * spread.max()
    kappa = fit.distribution.quantile("kappa", special.ndtr([-1.0, 1.0]))
    assert kappa == pytest.approx(fit.derived["kappa"].interval68, rel=0.02)
    theta = np.insert(middle, list(problem.parameters.names).index("e_n"), 0.94)
    assert problem.predict(theta).shape == problem.predict(np.stack([theta, theta]))[0].shape


def test_an_inertia_factor_may_be_written_as_a_fraction():
    for given in ("2/3", 2 / 3, Fraction(2, 3), "0.6666666666666666"):
        assert ifrfit.Model(inertia_factor=given).inertia_factor == pytest.approx(2 / 3, abs=1e-15)
    for given in ("2/0", "two", "2/3/4", True):
        with refused(UsageError, match="is not a number, nor two as 2/3"):
            ifrfit.Model(inertia_factor=given)
