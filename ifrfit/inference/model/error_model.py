"""The errors of the rows as the user described them: tails, errors of angle and spin, what was measured."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ifrfit.errors import UsageError
from ifrfit.inference.model.error_law import ERROR_LAWS, GAUSSIAN, STUDENT_T, ErrorLaw

if TYPE_CHECKING:
    from ifrfit.physics.closure import Closure

ITERATED = "weights iterated"  # end of the road by which such a fit was found
ANGLES = ("none", "effective", "set", "measured")


@dataclass(frozen=True)
class ErrorModel:
    """Law of the measured values, given the constants.

    Attributes
    ----------
    dof : float or None
        Degrees of freedom of the law of errors, by default its own; None for one without, such as the
        Gaussian.
    angles : {"none", "effective", "set", "measured"}
        Errors of angle and spin. none: taken as exact. effective: added to the error of the value through the
        slope (effective variance). set: the true angle scatters about the set one (Berkson), and is
        integrated out. measured: the measured angle scatters about the true one (classical), and the true
        ones are spread evenly over `population`.
    population : (float, float) or None
        Degrees; where true angles lie, for `angles` "measured".
    gamma : float or None
        Standard uncertainty of the angle, degrees, of rows that state none.
    velocity, spin : float or None
        Standard uncertainties of the measured velocities after impact, and of R Omega, per incoming speed:
        the errors of all rows are propagated from them.
    tails : str
        Name of the law of errors, in `ERROR_LAWS`. Left empty it becomes gaussian without `dof`, student-t
        with it.
    offset : float or None
        Prior sd, degrees, of an unknown offset that all set angles of incidence have in common; None where
        there is none. See `ifrfit.inference.model.problem.Problem.at_offset`.

    Raises
    ------
    UsageError
        For a choice that does not exist, or choices that contradict.
    """

    # in files they go by the names of the options
    dof: float | None = None
    angles: str = field(default="none", metadata={"key": "angle_errors"})
    population: tuple[float, float] | None = field(default=None, metadata={"key": "angle_population"})
    gamma: float | None = field(default=None, metadata={"key": "sigma_gamma"})
    velocity: float | None = field(default=None, metadata={"key": "sigma_velocity"})
    spin: float | None = field(default=None, metadata={"key": "sigma_spin"})
    tails: str = ""
    offset: float | None = field(default=None, metadata={"key": "angle_offset", "optional": True})

    def __post_init__(self) -> None:
        if not self.tails:
            object.__setattr__(self, "tails", GAUSSIAN.name if self.dof is None else STUDENT_T.name)
        if self.tails not in ERROR_LAWS:
            raise UsageError(f"--tails {self.tails}: choose {' or '.join(ERROR_LAWS)}.")
        default_dof = self.law.default_dof
        if self.dof is None:
            object.__setattr__(self, "dof", default_dof)
        elif default_dof is None:
            with_dof = " or ".join(name for name, law in ERROR_LAWS.items() if law.default_dof is not None)
            raise UsageError(f"--dof belongs to --tails {with_dof}: add it, or leave --dof out.")
        elif not 1.0 <= self.dof <= 1e6:
            raise UsageError(f"--dof {self.dof:g}: choose 1 (Cauchy) or more; 4 is usual.")
        self._check_angles()
        self._check_offset()
        for option, value in (("--sigma-velocity", self.velocity), ("--sigma-spin", self.spin)):
            if value is not None and not 0.0 < value < math.inf:
                raise UsageError(f"{option} {value:g}: it must be positive (per incoming speed).")
        if self.spin is not None and self.velocity is None:
            raise UsageError("--sigma-spin needs --sigma-velocity: errors are propagated from both.")

    def _check_angles(self) -> None:
        """Refuse errors of angles that do not exist, and values that do not belong to them."""
        angles, population, gamma = self.angles, self.population, self.gamma
        if angles not in ANGLES:
            raise UsageError(f"--angle-errors {angles}: choose {', '.join(ANGLES[:-1])} or {ANGLES[-1]}.")
        if angles == "measured" and population is None:
            raise UsageError(
                "--angle-errors measured needs --angle-population LO,HI: the degrees between which the true "
                "angles lie. What is known of them enters the result."
            )
        if population is not None:
            if angles != "measured":
                raise UsageError(
                    "--angle-population belongs to --angle-errors measured: choose that, or leave it out."
                )
            low, high = population
            if not 0.0 <= low < high <= 90.0:
                raise UsageError(f"--angle-population {low:g},{high:g}: write LO,HI with 0 <= LO < HI <= 90.")
        if gamma is not None:
            if angles == "none":
                raise UsageError("--sigma-gamma needs --angle-errors effective, set or measured.")
            if not 0.0 < gamma <= 45.0:
                raise UsageError(f"--sigma-gamma {gamma:g}: it must lie above 0 and at most at 45 degrees.")

    def _check_offset(self) -> None:
        """Refuse a prior of the angle offset that is none, and errors beside which it cannot be fitted."""
        if self.offset is None:
            return
        if not 0.0 < self.offset <= 30.0:
            raise UsageError(
                f"--angle-offset {self.offset:g}: give the standard deviation of its prior, above 0 and at "
                "most 30 degrees."
            )
        if not self.is_plain:
            raise UsageError(
                "--angle-offset is fitted beside independent Gaussian errors of the values only: leave "
                f"{self.option} out."
            )

    @property
    def law(self) -> ErrorLaw:
        """The law of errors."""
        return ERROR_LAWS[self.tails]

    @property
    def is_plain(self) -> bool:
        """Whether errors are independent, Gaussian, and of the values alone, given the offset if any."""
        return self.tails == GAUSSIAN.name and self.angles == "none"

    @property
    def beyond_plain(self) -> tuple[str, ...]:
        """The options that need the rows one by one, for messages; empty where errors are plain."""
        said = [f"--tails {self.tails}"] if self.tails != GAUSSIAN.name else []
        said += [f"--angle-errors {self.angles}"] if self.angles != "none" else []
        return (*said, *(["--angle-offset"] if self.offset is not None else []))

    @property
    def integrates(self) -> bool:
        """Whether true angles and spins are integrated out."""
        return self.angles in ("set", "measured")

    @property
    def propagates(self) -> bool:
        """Whether the errors of the rows come from those of the measured velocities and spins."""
        return self.velocity is not None

    @property
    def option(self) -> str:
        """The option that makes it other than plain, for messages."""
        return f"--angle-errors {self.angles}" if self.angles != "none" else f"--tails {self.tails}"

    def check_closure(self, closure: Closure) -> None:
        """Refuse a closure that does not know these errors.

        Raises
        ------
        UsageError
        """
        if not self.is_plain and not closure.bilinear:
            raise UsageError(
                f"Closure {closure.title} knows independent Gaussian errors of the values only: leave "
                f"{self.option} out, or choose another closure."
            )

    @property
    def words(self) -> str:
        """The choice in a few words; empty where all is plain."""
        parts = [words] if (words := self.law.words(self.dof)) else []
        if self.propagates:
            spin = f", spin {self.spin:g}" if self.spin is not None else ""
            parts.append(f"errors propagated from velocity {self.velocity:g}{spin} (per incoming speed)")
        if self.angles == "effective":
            parts.append("errors of angle and spin by effective variance")
        elif self.angles == "set":
            parts.append("angles and spins scatter about the set ones, integrated out")
        elif self.angles == "measured":
            assert self.population is not None
            low, high = self.population
            parts.append(
                "measured angles and spins scatter about the true ones, "
                f"integrated out over angles from {low:g} to {high:g} degrees"
            )
        if self.offset is not None:
            parts.append(f"angle offset fitted (prior 0 +- {self.offset:g} degrees)")
        return "; ".join(parts)


PLAIN = ErrorModel()
