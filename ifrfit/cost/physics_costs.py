"""What a contact law costs, and how far its beta lies from the exact one of a compliant contact."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.cost.timing import Cost, one_thread, timed
from ifrfit.data.observations import Observations, make_table
from ifrfit.errors import UsageError
from ifrfit.inference.model.prior_specification import make_parameters
from ifrfit.inference.model.problem import make_problem
from ifrfit.inference.optimize.solve import solve
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closure import Closure, rotational_share
from ifrfit.physics.closures import CLOSURES, get_closure
from ifrfit.physics.compiling import available
from ifrfit.physics.compliance import rebound_ratio
from ifrfit.physics.compliance.law import HIGHEST_CHI, LOWEST_CHI, Compliance
from ifrfit.physics.kernels import has_loop, rebound_many
from ifrfit.physics.rebound import rebound_of

Array = NDArray[np.float64]

MOST_IMPACTS = 40  # that the error is looked for at
MANY, FEW = 200_000, 2_000  # impacts a call: closures and table; Stronge's model
FEWER = 4  # impacts a call: annuli, where one takes milliseconds
INERTIA = 0.4
SHARE = rotational_share(INERTIA)


@dataclass(frozen=True)
class Extent:
    """How much is measured.

    Attributes
    ----------
    memory, annuli : tuple of int
        Steps and annuli that are tried.
    reference : int
        Steps of the memory function that everything is held against.
    repeats : int
    enough : float
        Least seconds of a repeat.
    """

    memory: tuple[int, ...]
    annuli: tuple[int, ...]
    reference: int
    repeats: int
    enough: float


WHOLE = Extent((50, 200, 1000, 4000, 16_000), (10, 20, 40, 80), 64_000, 5, 0.05)
QUICK = Extent((50, 200, 1000), (10, 20), 16_000, 3, 0.01)


def physics_costs(
    *,
    gamma_deg: ArrayLike,
    spin_y: ArrayLike,
    e_n: float,
    mu: float,
    chi: float,
    given: Mapping[str, float] | None = None,
    quick: bool = False,
) -> list[Cost]:
    """Time an impact takes, and error of beta, of every contact law that is computed here.

    Parameters
    ----------
    gamma_deg, spin_y : array_like
        Impacts, which broadcast. Of more than 40 different ones 40 are taken, evenly by their slip ratio and
        with both ends; those without slip or without approach have no beta and are left out.
    e_n, mu, chi : float
        Of the compliant contact that is taken for true; a solid sphere.
    given : mapping of str to float, optional
        Closure to its own constant, with this mu. Every other closure takes the constants with which it comes
        closest to the exact beta of these impacts in least squares.
    quick : bool
        Fewer settings and repeats.

    Returns
    -------
    list of Cost
        Kind ``physics``, quantity ``beta``, error unit ``1``, seconds an impact: closures and table on
        200,000 impacts a call, Stronge's model on 2,000, memory function on the impacts themselves, annuli on
        four of them; one thread. The error is the largest one over the impacts, and never below that of the
        reference.

    Raises
    ------
    UsageError
        If e_n, mu or chi is impossible, or no impact has a beta.

    Notes
    -----
    The reference is the solution of Maw, Barber & Fawcett (1976) by the memory function with 64,000 steps
    (quick: 16,000). Its own row states how far it moves when the steps are halved, over 3: for an error that
    falls with the square of the steps that is what is left of it. For e_n < 1 the elastic solution is scaled,
    which is an assumption of its own, see `scaling_doubt`. It is in none of these errors but that of
    Stronge's model with e_n as it is, which is not scaled.
    """
    scene = Scene.of(gamma_deg, spin_y, e_n, mu, chi)
    extent = QUICK if quick else WHOLE
    exact, own = scene.reference(extent.reference)
    found = []
    for law in (
        *_closures(scene, exact, given or {}),
        *_table(scene),
        *_stronge(scene),
        *_solvers(scene, extent),
    ):
        with one_thread():
            time = timed(law.call, repeats=extent.repeats, enough=extent.enough).per(law.impacts)
        error = max(float(np.max(np.abs(law.beta - exact))), own)
        found.append(Cost("physics", law.method, law.setting, "beta", time, error, "1"))
    time = timed(lambda: scene.solved("memory", extent.reference), repeats=1, enough=0.0)
    setting = f"{extent.reference} steps: the reference"
    return [
        *found,
        Cost("physics", "memory function", setting, "beta", time.per(scene.psi1.size), own, "1"),
    ]


def scaling_doubt(*, gamma_deg: ArrayLike, spin_y: ArrayLike, e_n: float, mu: float, chi: float) -> float:
    """How much of beta hangs on the scaling to e_n < 1: arguments as in `physics_costs`.

    Returns
    -------
    float
        Largest distance in beta between Stronge's model as it is, and his elastic one scaled; 0 at e_n = 1.
    """
    scene = Scene.of(gamma_deg, spin_y, e_n, mu, chi)
    scaled, as_it_is = (beta for _, _, beta in scene.stronge())
    return float(np.max(np.abs(scaled - as_it_is)))


@dataclass(frozen=True)
class Scene:
    """The impacts, and the compliant contact.

    Attributes
    ----------
    incidence : Incidence
        In the order of their slip ratio, with slip and approach.
    psi1 : ndarray, (n,)
        Scaled contact velocity, see `ifrfit.physics.compliance.rebound_ratio`.
    e_n, mu, chi : float
    """

    incidence: Incidence
    psi1: Array
    e_n: float
    mu: float
    chi: float

    @classmethod
    def of(cls, gamma_deg: ArrayLike, spin_y: ArrayLike, e_n: float, mu: float, chi: float) -> Scene:
        """Pick the impacts."""
        if not (0.0 <= e_n <= 1.0 and 0.0 < mu < np.inf and 0.0 < chi < np.inf):
            raise UsageError(
                f"e_n = {e_n:g}, mu = {mu:g}, chi = {chi:g}: e_n must lie in 0 to 1, mu and chi above 0."
            )
        gamma, spin = (x.ravel() for x in np.broadcast_arrays(*map(np.asarray, (gamma_deg, spin_y))))
        tau = Incidence.of(gamma, 0.0, spin, degrees=True).tau
        usable = np.flatnonzero((tau > 0.0) & np.isfinite(tau))
        if usable.size == 0:
            raise UsageError("No impact has both slip and approach, so none has a beta. Give other angles.")
        _, first = np.unique(tau[usable], return_index=True)
        places = np.linspace(0, first.size - 1, min(first.size, MOST_IMPACTS)).round().astype(int)
        rows = usable[first[places]]
        incidence = Incidence.of(gamma[rows], 0.0, spin[rows], degrees=True)
        return cls(incidence, 2.0 * chi * SHARE * tau[rows] / mu, e_n, mu, chi)

    def solved(self, method: str, steps: int | None = None) -> Array:
        """beta by a solver of the compliant contact."""
        ratio = rebound_ratio(self.psi1, self.chi, method=method, e_n=self.e_n, steps=steps)
        return np.asarray(-ratio / self.psi1)

    def reference(self, steps: int) -> tuple[Array, float]:
        """beta at so many steps, and its error from what half of them give."""
        fine, coarse = self.solved("memory", steps), self.solved("memory", steps // 2)
        return fine, float(np.max(np.abs(fine - coarse))) / 3.0

    def stronge(self) -> Iterator[tuple[str, Callable[[Array], Array], Array]]:
        """Stronge's model in its two ways to e_n < 1: setting, psi2 of psi1, beta."""
        scale = 0.5 * (1.0 + self.e_n)
        ways: dict[str, Callable[[Array], Array]] = {
            "elastic, scaled": lambda psi1: scale * rebound_ratio(psi1 / scale, self.chi, method="stronge"),
            "e_n as it is": lambda psi1: rebound_ratio(psi1, self.chi, method="stronge", e_n=self.e_n),
        }
        for setting, ratio in ways.items():
            yield setting, ratio, -ratio(self.psi1) / self.psi1

    def repeated(self, count: int) -> Incidence:
        """So many impacts, these over and over."""
        rows = np.resize(np.arange(self.psi1.size), count)
        return self.incidence.take(rows)


def closest(closure: Closure, incidence: Incidence, beta: Array, e_n: float) -> tuple[float, float]:
    """Least squares of beta over these impacts, in the passive domain, every impact with equal weight.

    Parameters
    ----------
    closure : Closure
        Of a bilinear one the optimum is the global one, see `ifrfit.inference.optimize.solve.solve`; of
        another, the best of many local ones.
    incidence : Incidence
        Of solid spheres, without lateral spin.
    beta : ndarray, (n,)
    e_n : float
        Held, because beta knows mu (1 + e_n) only.

    Returns
    -------
    own, mu : float
        The closure's own constant, 0 where it has none, and friction.
    """
    gamma = np.degrees(np.arctan2(incidence.sine, incidence.cosine))
    columns = {"series": "", "observable": "beta", "gamma_deg": gamma, "spin_y": incidence.spin_y}
    table = make_table(columns | {"value": beta, "sigma": 1.0, "provenance": "simulated"})
    constants = make_parameters(closure, INERTIA, fix={"e_n": e_n})
    problem = make_problem(Observations(table), closure, INERTIA, constants, "known")
    theta = dict(
        zip(problem.parameters.names, solve(problem, problem.noise.sigma).theta.tolist(), strict=True)
    )
    return theta.get(closure.constant or "", 0.0), theta["mu"]


class Law(NamedTuple):
    """One way to compute beta: its name, what it gives, and a call of so many impacts to be timed."""

    method: str
    setting: str
    beta: Array
    call: Callable[[], object]
    impacts: int


def _closures(scene: Scene, exact: Array, given: Mapping[str, float]) -> Iterator[Law]:
    for name, closure in CLOSURES.items():
        if isinstance(closure.law(INERTIA), Compliance):
            continue  # that is the table
        words = "given" if name in given else "closest"
        own, mu = (
            (given[name], scene.mu) if name in given else closest(closure, scene.incidence, exact, scene.e_n)
        )
        numbers = [f"{closure.constant} = {own:.4g}"] if closure.constant else []
        setting = ", ".join([*numbers, f"mu = {mu:.4g}", words])
        yield from _vectorised(scene, f"closure {closure.title}", setting, closure, own, mu)


def _table(scene: Scene) -> Iterator[Law]:
    if LOWEST_CHI <= scene.chi <= HIGHEST_CHI:
        yield from _vectorised(scene, "table", "", get_closure("maw"), scene.chi, scene.mu)


def _vectorised(
    scene: Scene, method: str, setting: str, closure: Closure, own: float, mu: float
) -> Iterator[Law]:
    """A closure on very many impacts: by numpy, and compiled where numba is there."""
    many, constants = scene.repeated(MANY), (closure, scene.e_n, own, mu, INERTIA)
    beta = np.asarray(rebound_of(scene.incidence, *constants).beta)
    yield Law(method, _words(setting, "numpy"), beta, partial(rebound_of, many, *constants), MANY)
    if not available() or not has_loop(closure, INERTIA):
        return
    more: dict[str, Any] = {"e_n": scene.e_n, "mu": mu, "closure": closure.name}
    more |= {closure.constant: own} if closure.constant else {}
    out = [np.empty(MANY) for _ in range(3)]
    loop = partial(rebound_many, many.sine, many.cosine, many.spin_y, out=out, **more)
    yield Law(method, _words(setting, "compiled"), beta, loop, MANY)


def _words(*parts: str) -> str:
    return "; ".join(part for part in parts if part)


def _stronge(scene: Scene) -> Iterator[Law]:
    psi1 = np.resize(scene.psi1, FEW)
    for setting, ratio, beta in scene.stronge():
        if setting != "e_n as it is" or scene.e_n < 1.0:
            words = setting if scene.e_n < 1.0 else ""
            yield Law("Stronge's model", words, beta, partial(ratio, psi1), FEW)


def _solvers(scene: Scene, extent: Extent) -> Iterator[Law]:
    """Annuli and memory function, on the impacts themselves."""
    few = np.linspace(0, scene.psi1.size - 1, FEWER).round().astype(int)
    for annuli in extent.annuli:
        one = partial(rebound_ratio, scene.psi1[few], scene.chi, method="annuli", e_n=scene.e_n, steps=annuli)
        yield Law("annuli", f"{annuli} annuli", scene.solved("annuli", annuli), one, FEWER)
    for steps in extent.memory:
        all_of_them = partial(scene.solved, "memory", steps)
        setting = _words(f"{steps} steps", "" if available() else "plain Python")
        yield Law("memory function", setting, all_of_them(), all_of_them, scene.psi1.size)
