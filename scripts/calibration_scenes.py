"""Scenes of the simulation-based calibration: truth from the prior, impacts from the truth."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from simulated import simulated

from ifrfit.inference.model.apply_error_model import with_error_model, with_propagated_sigma
from ifrfit.inference.model.error_model import PLAIN, ErrorModel
from ifrfit.inference.model.parameters import ParameterSet
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.physics import rebound
from ifrfit.physics.closure import Closure, rotational_share
from ifrfit.physics.closures import get_closure
from ifrfit.physics.impulse_laws import Coefficients

Array = NDArray[np.float64]
Range = tuple[float, float]

INERTIA = 0.4
CLOSURE = "ifr"
ALWAYS_SLIDES = 1e6  # limit of the friction impulse that no impact reaches


@dataclass(frozen=True)
class Scene:
    """What is drawn, and what is measured.

    Attributes
    ----------
    name : str
    says : str
        What the scene is for.
    bounds : mapping
        Constant to the ends of its uniform prior.
    gamma : (float, float)
        Angles of the rows of beta, degrees, drawn uniformly.
    n_beta, n_e_n : int
        Rows of each observable.
    sigma : mapping
        Observable to its standard uncertainty; empty where it is unknown.
    noise_bounds : mapping
        Observable (or "": a common factor on sigma) to the ends of its log-uniform prior; empty where sigma
        is known.
    series : tuple of str
        Each has its own rows of both observables.
    separate : tuple of str
        Constants that each series has for itself.
    share : float
        Of the repeats: scenes beside the four main ones take longer each.
    error_model : ErrorModel
        How rows of beta scatter beyond their sigma.
    """

    name: str
    says: str
    bounds: Mapping[str, Range]
    gamma: Range
    n_beta: int
    n_e_n: int
    sigma: Mapping[str, float] = field(default_factory=dict)
    noise_bounds: Mapping[str, Range] = field(default_factory=dict)
    series: tuple[str, ...] = ("run",)
    separate: tuple[str, ...] = ()
    share: float = 1.0
    error_model: ErrorModel = PLAIN

    @property
    def policy(self) -> str:
        """Noise policy of the problem."""
        if not self.noise_bounds:
            return "known"
        return "unknown" if "" not in self.noise_bounds else "scaled"

    @property
    def noise_groups(self) -> dict[str, Range]:
        """Group of rows as the problem names it to the ends of its noise."""
        if self.policy != "unknown":
            return dict(self.noise_bounds)
        return {f"{s}/{name}": ends for s in self.series for name, ends in self.noise_bounds.items()}

    def label(self, quantity: str, series: str) -> str:
        """Name of a constant, or of kappa, of one series."""
        makes = {"e_n", "mu"} if quantity == "kappa" else {quantity}
        return f"{quantity}[{series}]" if makes & set(self.separate) else quantity


def _scenes(kind: str) -> dict[str, Scene]:
    """Scenes of one kind by name; true values of measured angles come from between the scene's."""
    found = {}
    for name, entry in _TABLES[kind].items():
        scatter = dict(entry.pop("error_model", {}))
        if scatter.get("angles") == "measured":
            scatter["population"] = tuple(entry["gamma"])
        for key in ("gamma", "series", "separate"):
            if key in entry:
                entry[key] = tuple(entry[key])
        bounds = _TABLES["priors"][entry.pop("prior")]
        found[name] = Scene(name, bounds=bounds, error_model=ErrorModel(**scatter), **entry)
    return found


_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
SCENES = _scenes("plain")
SCATTERED = _scenes("scattered")  # the exact posterior under every scatter that is not plain


@dataclass(frozen=True)
class Experiment:
    """One simulated experiment.

    Attributes
    ----------
    scene : Scene
    truth : mapping
        True value of every quantity that a posterior names.
    problem : Problem
        What the estimators see.
    """

    scene: Scene
    truth: Mapping[str, float]
    problem: Problem


def draw_truth(scene: Scene, rng: np.random.Generator) -> dict[str, float]:
    """Draw every constant and noise from its prior."""
    truth: dict[str, float] = {}
    for name, ends in scene.bounds.items():
        for series in scene.series if name in scene.separate else scene.series[:1]:
            truth[scene.label(name, series)] = float(rng.uniform(*ends))
    for series in scene.series:
        e_n, mu = (truth[scene.label(name, series)] for name in ("e_n", "mu"))
        truth[scene.label("kappa", series)] = mu * (1.0 + e_n)
    for group, (low, high) in scene.noise_groups.items():
        truth[f"noise[{group}]" if group else "noise"] = math.exp(rng.uniform(math.log(low), math.log(high)))
    return truth


def simulate(scene: Scene, rng: np.random.Generator) -> Experiment:
    """Draw a truth and measure it: ``value = model(truth) + sigma * N(0, 1)``, independent rows."""
    truth = draw_truth(scene, rng)
    n = scene.n_beta + scene.n_e_n
    observable = np.repeat(["beta", "e_n"], (scene.n_beta, scene.n_e_n))
    gamma, value, sigma = [], [], []
    for series in scene.series:
        e_n, e_t, mu = (truth[scene.label(name, series)] for name in ("e_n", "e_t", "mu"))
        angle, true = _angles(scene, rng)
        beta = rebound(true, e_n=e_n, e_t=e_t, mu=mu, closure=CLOSURE, degrees=True).beta
        size = {name: _size(scene, truth, series, name) for name in ("beta", "e_n")}
        noise = np.array([size[str(name)] for name in observable])
        if (
            scene.error_model.propagates
        ):  # measured is the velocity, and divided by what the angle says it was
            beta = beta * np.sin(np.radians(true)) / np.sin(np.radians(angle))
            noise[: scene.n_beta] /= np.sin(np.radians(angle))
        dof = scene.error_model.dof
        errors = rng.standard_normal(n) if dof is None else rng.standard_t(dof, n)
        gamma.append(np.concatenate((angle, np.full(scene.n_e_n, np.nan))))
        value.append(np.concatenate((beta, np.full(scene.n_e_n, e_n))) + noise * errors)
        sigma.append([scene.sigma.get(str(name), math.nan) for name in observable])
    rows = (np.concatenate(part) for part in (gamma, value, sigma))
    data = simulated(np.tile(observable, len(scene.series)), *rows, series=np.repeat(scene.series, n))
    closure = get_closure(CLOSURE)
    constants = make_parameters(closure, INERTIA, bounds=dict(scene.bounds), separate=scene.separate)
    observations = with_propagated_sigma(data, scene.error_model)
    problem = make_problem(observations, closure, INERTIA, constants, scene.policy)
    problem = with_error_model(problem, scene.error_model)
    if scene.noise_bounds:
        problem = problem.with_noise(problem.noise.with_bounds(scene.noise_groups))
    return Experiment(scene, truth, problem)


def _angles(scene: Scene, rng: np.random.Generator) -> tuple[Array, Array]:
    """Angles as they are on record, and as they truly were; degrees."""
    first = rng.uniform(*scene.gamma, scene.n_beta)
    if not scene.error_model.integrates:
        return first, first
    second = first + (scene.error_model.gamma or 0.0) * rng.standard_normal(scene.n_beta)
    return (first, second) if scene.error_model.angles == "set" else (second, first)


def _size(scene: Scene, truth: Mapping[str, float], series: str, observable: str) -> float:
    """Noise that a row really has."""
    if scene.policy == "unknown":
        return truth[f"noise[{series}/{observable}]"]
    return truth.get("noise", 1.0) * scene.sigma[observable]


def share_sliding(experiment: Experiment) -> float:
    """Share of the rows of beta that slide at the truth."""
    problem = experiment.problem
    theta = np.array([experiment.truth[name] for name in problem.parameters.names])
    _, sticks = problem.impulse(*problem.per_row(theta))
    return float(1.0 - sticks[problem.rows.rows_of("beta")].mean())


def understated_sigma(experiment: Experiment, factor: float) -> Experiment:
    """The same rows, with a sigma that claims to be smaller than it is: a wrong likelihood."""
    noise = experiment.problem.noise
    problem = experiment.problem.with_noise(replace(noise, sigma=factor * noise.sigma))
    return replace(experiment, problem=problem)


def without_kink(experiment: Experiment) -> Experiment:
    """The same rows, in the eyes of a model in which every impact slides: a wrong likelihood."""
    share = rotational_share(INERTIA)
    right = experiment.problem.closure
    slides = Closure(
        right.name,
        "IFR without its sticking",
        lambda _: Coefficients(share, share, ALWAYS_SLIDES, 0.0),
        right.source,
        right.own,
    )
    return replace(experiment, problem=replace(experiment.problem, closure=slides))


def walton(experiment: Experiment) -> Experiment:
    """The same rows, in the eyes of closure FR: beta0 of sticking is e_t + 7/5, its sliding has no e_t."""
    closure = get_closure("fr")
    bounds = dict(experiment.scene.bounds)
    low, high = bounds.pop("e_t")
    bounds["beta0"] = (low + 1.4, high + 1.4)
    constants = make_parameters(closure, INERTIA, bounds=bounds)
    truth = {**experiment.truth, "beta0": experiment.truth["e_t"] + 1.4}
    del truth["e_t"]
    problem = replace(
        experiment.problem, closure=closure, parameters=ParameterSet(constants, experiment.problem.series)
    )
    return replace(experiment, truth=truth, problem=problem)
