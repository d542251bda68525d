"""What a user chooses of a question: the model and the noise, as frozen objects."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from ifrfit.errors import UsageError
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.model.error_model import ANGLES, ErrorModel
from ifrfit.inference.option_fields import Options, nested, option, plain
from ifrfit.text import number_of

if TYPE_CHECKING:
    from ifrfit.inference.model.parameters import Parameter
    from ifrfit.inference.model.prior_laws import PriorLaw
    from ifrfit.physics.closure import Closure

POLICIES = ("known", "scaled", "unknown", "mixed")

NOISE = "noise"  # among the names that may be separate

Range = tuple[float, float]


def _closures() -> Iterable[str]:
    from ifrfit.physics.closures import CLOSURES

    return CLOSURES


def _constants() -> Iterable[str]:
    from ifrfit.physics.closures import CLOSURES

    return dict.fromkeys(name for closure in CLOSURES.values() for name in closure.constants)


def _pairs() -> Iterable[str]:
    from ifrfit.data.materials import all_pairs

    return dict.fromkeys(each.name for each in all_pairs())


def _separable() -> Iterable[str]:
    return (*_constants(), NOISE)


def _tails() -> Iterable[str]:
    from ifrfit.inference.model.error_law import ERROR_LAWS

    return ERROR_LAWS


@dataclass(frozen=True, repr=False)
class Model(Options):
    """Closure and constants of a fit.

    Attributes
    ----------
    closure : str
        ifr, fr, f, ifr-contact, maw, or a registered one.
    fix : mapping of str to float
        Constant to its known value.
    prior : mapping of str to (float, float) or a law
        Constant to mean and standard deviation of an earlier measurement; or `Normal`, `TruncatedNormal`,
        `HalfNormal`, `Uniform`, `LogNormal`, `Beta`.
    prior_from : str or None
        A pair of materials, "BODY/OTHER", whose published constants are priors, but for those that `fix` or
        `prior` name.
    bounds : mapping of str to (float, float)
        Constant to lower and upper bound, in the place of the passive domain.
    separate : str or collection of str
        Constants with a value of their own in each series; "noise" for unknown noises.
    tie : mapping of str to str
        Constant, or "mu[series]" where it is separate, to an expression of others in lmfit's syntax:
        ``{"e_t": "-1 + 0.1*mu"}``, ``{"e_t[b]": "e_t[a]"}``. Known to least squares and mcmc.
    inertia_factor : float or None
        J = I/(m R^2), a number or as "2/3"; by default the dataset's, else 2/5.

    Raises
    ------
    UsageError
        If the inertia factor is not positive.

    Examples
    --------
    >>> import ifrfit
    >>> model = ifrfit.Model("fr", fix={"e_n": 0.97}, prior={"mu": ifrfit.LogNormal(0.1, 0.3)})
    >>> ifrfit.fit("cornell-glass", model).constants.beta0.status
    'determined'
    """

    closure: str = option(
        "ifr", "ifr, fr, f, ifr-contact, maw; any other word lists all.", metavar="NAME", choices=_closures
    )
    _: KW_ONLY
    fix: Mapping[str, float] = option(
        {}, "A constant that you know.", form="values", metavar="NAME=VALUE", choices=_constants
    )
    prior: Mapping[str, Range | PriorLaw] = option(
        {}, "A constant that you measured before.", form="priors", metavar="NAME=MEAN,SD", choices=_constants
    )
    prior_from: str | None = option(
        None, "Priors published for a pair of materials.", metavar="BODY/OTHER", choices=_pairs
    )
    bounds: Mapping[str, Range] = option(
        {},
        "Bounds in the place of the physical ones.",
        form="pairs",
        metavar="NAME=LO,HI",
        choices=_constants,
    )
    separate: str | Collection[str] = option(
        (),
        "These constants, or noise, have a value of their own in each series.",
        form="words",
        metavar="NAME,...",
        choices=_separable,
    )
    tie: Mapping[str, str] = option(
        {},
        "A constant that follows from others, for lsq and mcmc.",
        form="expressions",
        metavar="NAME=EXPRESSION",
        choices=_constants,
    )
    inertia_factor: float | None = option(
        None,
        "I/(m R^2): 2/5 solid, 2/3 hollow ball, 1/2 disc.",
        form="fraction",
        metavar="J",
        unset="the dataset's, else 2/5",
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "separate", plain(self.separate))
        super().__post_init__()
        for name in ("fix", "prior", "bounds", "tie"):
            object.__setattr__(self, name, dict(getattr(self, name) or {}))
        names = (self.separate,) if isinstance(self.separate, str) else tuple(self.separate or ())
        object.__setattr__(self, "separate", names)
        if self.inertia_factor is not None:
            object.__setattr__(self, "inertia_factor", number_of(self.inertia_factor))
        j = self.inertia_factor
        if j is not None and not 0.0 < j < math.inf:
            raise UsageError(f"--inertia-factor {j:g}: it must be positive (2/5 for a solid sphere).")

    def parameters(self, inertia_factor: float) -> tuple[Parameter, ...]:
        """The parameters of the closure as this model has them.

        Parameters
        ----------
        inertia_factor : float
            That of the data where the model has none.

        Raises
        ------
        UsageError
            For an unknown closure, a constant that it does not have, or choices that contradict.
        """
        from ifrfit.inference.model.prior_specification import make_parameters
        from ifrfit.physics.closures import get_closure

        return make_parameters(
            get_closure(self.closure),
            inertia_factor,
            fix=self.fix,
            prior=self._published(get_closure(self.closure).constants) | dict(self.prior),
            bounds=self.bounds,
            separate=tuple(name for name in self.separate if name != NOISE),
            tie=self.tie,
        )

    def _published(self, constants: Collection[str]) -> dict[str, Range]:
        """Priors of `prior_from` for these constants, but for those that the user says more of."""
        if self.prior_from is None:
            return {}
        from ifrfit.data.materials import CONSTANTS, find_pair, prior_values

        said = (*self.fix, *self.prior, *(name for name in CONSTANTS if name not in constants))
        return dict(prior_values(find_pair(self.prior_from), said))

    def published_words(self) -> tuple[str, ...]:
        """Where published priors come from, as a result names it; empty without them."""
        if self.prior_from is None:
            return ()
        from ifrfit.data.materials import find_pair
        from ifrfit.physics.closures import get_closure

        pair = find_pair(self.prior_from)
        used = self._published(get_closure(self.closure).constants)
        taken = {name: both for name, both in pair.values.items() if name in used}
        if not taken:
            return ()
        words = ", ".join(f"{name} {value:g} +- {error:g}" for name, (value, error) in taken.items())
        return (
            f"priors published for {pair.name} ({pair.geometry}, {pair.source}) of the constants that the "
            f"closure has ({words}; data of the same experiment would count twice)",
        )

    def with_closure(self, closure: Closure) -> Model:
        """The same with another closure, and of the choices those for constants that it has."""
        own = closure.constants
        return replace(
            self,
            closure=closure.name,
            fix={name: value for name, value in self.fix.items() if name in own},
            prior={name: value for name, value in self.prior.items() if name in own},
            bounds={name: value for name, value in self.bounds.items() if name in own},
            separate=tuple(name for name in self.separate if name in (*own, NOISE)),
            tie={name: text for name, text in self.tie.items() if quantity_of(name) in own},
        )

    def named_constants(self) -> Mapping[str, Iterable[str]]:
        """Constants that each of the choices names."""
        named = {key: tuple(getattr(self, key)) for key in ("fix", "prior", "bounds", "separate")}
        return named | {"separate": tuple(name for name in named["separate"] if name != NOISE)}


COMMON_ERRORS = ("counted", "ignored")


@dataclass(frozen=True, repr=False)
class AngleErrors(Options):
    """Errors of the angles and spins before impact.

    Attributes
    ----------
    kind : {"none", "effective", "set", "measured"}
        none: taken as exact. effective: added to sigma through the slope. set: the true angles scatter about
        the set ones (Berkson), and are integrated out. measured: the measured angles scatter about the true
        ones (classical), which are spread evenly over `population` and integrated out.
    sigma_deg : float or None
        Standard uncertainty of the angle, degrees, in rows that state none.
    population : (float, float) or None
        Degrees between which the true angles lie, for "measured".
    offset_sd : float or None
        Degrees: prior standard deviation, about 0, of an offset that all set angles have in common. It is
        fitted beside the constants. None: the angles are set without one.

    Raises
    ------
    UsageError
        For a kind that does not exist, or values that do not belong to it.

    Examples
    --------
    >>> import ifrfit
    >>> ifrfit.Noise("known", angles=ifrfit.AngleErrors("set", sigma_deg=1.0))
    Noise(policy='known', angles=AngleErrors(kind='set', sigma_deg=1.0))
    """

    kind: str = option(
        "none",
        "Errors of angle and spin: none, effective, set (Berkson), measured (classical).",
        metavar="KIND",
        keyword="angle_errors",
        choices=lambda: ANGLES,
    )
    _: KW_ONLY
    population: Range | None = option(
        None,
        "Degrees between which measured angles truly lie.",
        form="range",
        metavar="LO,HI",
        keyword="angle_population",
    )
    sigma_deg: float | None = option(
        None,
        "Uncertainty of angles whose row states none.",
        form="number",
        metavar="DEG",
        keyword="sigma_gamma",
    )
    offset_sd: float | None = option(
        None,
        "Fit a common offset of the angles; its prior sd.",
        form="number",
        metavar="DEG",
        keyword="angle_offset",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        ErrorModel(None, self.kind, self.population, self.sigma_deg, offset=self.offset_sd)  # which checks


@dataclass(frozen=True, repr=False)
class Noise(Options):
    """How the measured values scatter.

    Attributes
    ----------
    policy : {"known", "scaled", "unknown", "mixed"} or None
        What sigma means. mixed: known for each observable of a series whose rows all have a sigma, unknown
        for the others. By default the dataset's own policy, else mixed.
    tails : {"gaussian", "student-t"} or a registered one
        Law of the errors of the values.
    dof : float or None
        Degrees of freedom of Student's t; 4 by default.
    angles : AngleErrors or None
        None: angles and spins are exact.
    sigma_velocity, sigma_spin : float or None
        Standard uncertainties of measured velocities and of R Omega after impact, per incoming speed: every
        row's sigma is propagated from them.
    common_errors : {"counted", "ignored"}
        Whether errors that rows of a table have in common (its columns common1 and so on, as those of the
        calibration of a figure) are part of the errors; ignored, intervals are too short.

    Raises
    ------
    UsageError
        For a choice that does not exist, or choices that contradict.

    Examples
    --------
    >>> import ifrfit
    >>> noise = ifrfit.Noise("unknown", tails="student-t", dof=4)
    >>> ifrfit.fit("cornell-glass", noise=noise, observable="beta_cm", fix={"e_n": 0.97}).noise.policy
    'unknown'
    """

    policy: str | None = option(
        None,
        "What sigma means: known, scaled, unknown, or mixed: known where given.",
        metavar="KIND",
        keyword="noise",
        unset="the dataset's, else mixed",
        choices=lambda: POLICIES,
    )
    _: KW_ONLY
    tails: str = option(
        "gaussian",
        "Law of the errors: gaussian, or student-t where outliers occur; any other word lists all.",
        metavar="NAME",
        choices=_tails,
    )
    dof: float | None = option(
        None, "Degrees of freedom of student-t.", form="number", metavar="NU", unset="4"
    )
    angles: AngleErrors | None = nested(AngleErrors)
    sigma_velocity: float | None = option(
        None,
        "Propagate all errors from that of velocities, over incoming speed,",
        form="number",
        metavar="S",
    )
    sigma_spin: float | None = option(
        None, "and from that of R Omega, over incoming speed.", form="number", metavar="S"
    )
    common_errors: str = option(
        "counted",
        "Errors that rows share (common1, ...): counted or ignored.",
        metavar="CHOICE",
        choices=lambda: COMMON_ERRORS,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.policy is not None and self.policy not in POLICIES:
            raise UsageError(f"--noise {self.policy}: choose known, scaled, unknown or mixed.")
        if self.common_errors not in COMMON_ERRORS:
            raise UsageError(f"--common-errors {self.common_errors}: choose {' or '.join(COMMON_ERRORS)}.")
        _ = self.error_model  # which checks

    @cached_property
    def error_model(self) -> ErrorModel:
        """The law of the measured values."""
        angles = self.angles or AngleErrors()
        return ErrorModel(
            self.dof,
            angles.kind,
            angles.population,
            angles.sigma_deg,
            self.sigma_velocity,
            self.sigma_spin,
            self.tails,
            angles.offset_sd,
        )

    @property
    def is_plain(self) -> bool:
        """Whether errors are independent, Gaussian, and of the values alone."""
        return self.error_model.is_plain

    @property
    def counts_common_errors(self) -> bool:
        """Whether errors that rows have in common are part of the errors."""
        return self.common_errors == COMMON_ERRORS[0]

    def with_gaussian_values(self) -> Noise:
        """The same with independent Gaussian errors of the values; those propagated from velocities stay."""
        return replace(self, tails="gaussian", dof=None, angles=None)
