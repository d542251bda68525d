"""What was known of a constant before, by the name of its law.

A normal law, cut off at the domain of its constant or at ends of its own, and a uniform one belong to every
method, because least squares know them. `LogNormal` and `Beta` are densities of another shape: the methods
that evaluate densities take them, and the optimum is that with the normal law of their mean and sd.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError

Array = NDArray[np.float64]

_MOST = 1e3  # of a parameter of a shape
_FARTHEST = 8.0  # sd of the logarithm up to which a log-normal law reaches


@dataclass(frozen=True)
class PriorLaw(ABC):
    """A law by its name and its numbers: ``LogNormal(0.1, 0.3)``, in a shell ``lognormal:0.1,0.3``.

    Raises
    ------
    UsageError
        For numbers that make no law.
    """

    name: ClassVar[str]

    def __post_init__(self) -> None:
        if not all(_is_number(value) for value in self.numbers):
            raise UsageError(f"{self!r}: write finite numbers.")
        wrong = self._wrong()
        if wrong:
            raise UsageError(f"{self!r}: {wrong}.")

    @property
    def numbers(self) -> tuple[float, ...]:
        """What stands in the brackets."""
        return tuple(getattr(self, each.name) for each in fields(self))

    def __str__(self) -> str:
        return f"{self.name}:{','.join(f'{x:g}' if _is_number(x) else repr(x) for x in self.numbers)}"

    @property
    def exactly(self) -> str:
        """As text that loses no digit, for `read_law`."""
        return f"{self.name}:{','.join(repr(float(x)) for x in self.numbers)}"

    def _wrong(self) -> str:
        """What is wrong with the numbers; empty where nothing is."""
        return ""

    def ends(self, lower: float, upper: float) -> tuple[float, float]:
        """The domain of the constant under this law, within the one that it has."""
        return lower, upper

    @abstractmethod
    def moments(self, lower: float, upper: float) -> tuple[float, float] | None:
        """Mean and sd of the normal law that stands for it in least squares; None for a uniform law."""

    @property
    def words(self) -> str:
        """As a report says it."""
        return str(self)


class ShapedLaw(PriorLaw):
    """A law whose density is neither normal nor uniform."""

    @abstractmethod
    def log_density(self, value: Array, lower: float, upper: float) -> Array:
        """Log of its density between two ends, normalised there; (n,)."""


@dataclass(frozen=True)
class Normal(PriorLaw):
    """The normal law, cut off at the domain of its constant: what a tuple (mean, sd) means, too.

    Examples
    --------
    >>> import ifrfit
    >>> ifrfit.fit("cornell-glass", prior={"mu": ifrfit.Normal(0.12, 0.01)}).constants.mu.status
    'determined'
    """

    mean: float
    sd: float
    name: ClassVar[str] = "normal"

    def _wrong(self) -> str:
        return "" if self.sd > 0.0 else "the sd must be positive"

    def moments(self, lower: float, upper: float) -> tuple[float, float]:
        """Its own."""
        return self.mean, self.sd


@dataclass(frozen=True)
class TruncatedNormal(Normal):
    """The normal law between two ends.

    Examples
    --------
    >>> import ifrfit
    >>> law = ifrfit.TruncatedNormal(0.12, 0.01, 0.1, 0.14)
    >>> ifrfit.fit("cornell-glass", prior={"mu": law}).constants.mu.status
    'one_sided'
    """

    lower: float
    upper: float
    name: ClassVar[str] = "truncated"

    def _wrong(self) -> str:
        return super()._wrong() or (
            "" if self.lower < self.upper else "the lower end must lie below the upper one"
        )

    def ends(self, lower: float, upper: float) -> tuple[float, float]:
        """Its own ends."""
        return self.lower, self.upper


@dataclass(frozen=True)
class HalfNormal(PriorLaw):
    """The normal law about 0, of a constant that cannot be negative.

    Examples
    --------
    >>> import ifrfit
    >>> ifrfit.fit("cornell-glass", prior={"mu": ifrfit.HalfNormal(0.2)}).constants.mu.status
    'determined'
    """

    sd: float
    name: ClassVar[str] = "halfnormal"

    def _wrong(self) -> str:
        return "" if self.sd > 0.0 else "the sd must be positive"

    def moments(self, lower: float, upper: float) -> tuple[float, float]:
        """Of the whole normal law."""
        if lower < 0.0:
            raise UsageError(f"{self!r} is for a constant that begins at 0; this one begins at {lower:g}.")
        return 0.0, self.sd


@dataclass(frozen=True)
class Uniform(PriorLaw):
    """Equally probable between two ends, which are the bounds of the constant.

    Examples
    --------
    >>> import ifrfit
    >>> ifrfit.fit("cornell-glass", prior={"mu": ifrfit.Uniform(0.05, 0.2)}).constants.mu.status
    'determined'
    """

    lower: float
    upper: float
    name: ClassVar[str] = "uniform"

    def _wrong(self) -> str:
        return "" if self.lower < self.upper else "the lower end must lie below the upper one"

    def ends(self, lower: float, upper: float) -> tuple[float, float]:
        """Its own ends."""
        return self.lower, self.upper

    def moments(self, lower: float, upper: float) -> None:
        """None: bounds say it."""
        return


@dataclass(frozen=True)
class LogNormal(ShapedLaw):
    """The logarithm is normal: a constant known to a factor.

    Attributes
    ----------
    median : float
        Positive.
    log_sd : float
        sd of the natural logarithm: 0.1 is about 10 %.

    Examples
    --------
    >>> import ifrfit
    >>> ifrfit.fit("cornell-glass", prior={"mu": ifrfit.LogNormal(0.12, 0.1)}).constants.mu.status
    'determined'
    """

    median: float
    log_sd: float
    name: ClassVar[str] = "lognormal"

    def _wrong(self) -> str:
        if self.median <= 0.0:
            return "the median must be positive"
        return "" if 0.0 < self.log_sd <= 3.0 else "the sd of the logarithm must lie above 0 and at most at 3"

    def ends(self, lower: float, upper: float) -> tuple[float, float]:
        """Up to where all but 1e-15 of it lie, where its constant has no upper end."""
        farthest = self.median * math.exp(_FARTHEST * self.log_sd)
        return lower, min(upper, max(farthest, 1.0)) if math.isinf(upper) else upper

    def moments(self, lower: float, upper: float) -> tuple[float, float]:
        """Of the law cut off at the ends; Johnson, Kotz & Balakrishnan (1994), chapter 14."""
        from scipy.special import ndtr

        if upper <= 0.0:
            raise UsageError(f"{self!r} is for a positive constant; this one ends at {upper:g}.")
        s = self.log_sd
        low, high = (math.log(end / self.median) / s if end > 0.0 else -math.inf for end in (lower, upper))
        held = float(ndtr(high) - ndtr(low))
        if held <= 0.0:
            raise UsageError(
                f"{self!r}: nothing of it lies between {lower:g} and {upper:g}. Widen the bounds."
            )
        first, second = (float(ndtr(high - k * s) - ndtr(low - k * s)) / held for k in (1, 2))
        mean = self.median * math.exp(0.5 * s * s)
        # second/first^2 is 1 where nothing is cut off: the rest keeps the digits of a narrow law
        ratio = math.expm1(s * s) + math.exp(s * s) * (second / first**2 - 1.0)
        return mean * first, mean * first * math.sqrt(max(ratio, 0.0))

    def log_density(self, value: Array, lower: float, upper: float) -> Array:
        """Log of its density between two ends."""
        from scipy.special import ndtr

        def z(x: Array | float) -> Array:
            with np.errstate(divide="ignore"):
                return np.asarray(np.log(np.maximum(x, 0.0) / self.median) / self.log_sd)

        inside = float(ndtr(z(upper)) - ndtr(z(max(lower, 0.0))))
        with np.errstate(divide="ignore", invalid="ignore"):
            found = (
                -0.5 * z(value) ** 2
                - np.log(value)
                - math.log(self.log_sd * math.sqrt(2.0 * math.pi) * inside)
            )
        return np.where(np.asarray(value) > 0.0, found, -np.inf)

    @property
    def words(self) -> str:
        """With its median."""
        return f"log-normal with median {self.median:.6g} and {self.log_sd:.6g} as sd of the logarithm"


@dataclass(frozen=True)
class Beta(ShapedLaw):
    """The beta law over the domain of its constant.

    Attributes
    ----------
    a, b : float
        At least 1, so that the density is finite: proportional to t^(a-1) (1-t)^(b-1), t from 0 to 1 over the
        domain.

    Examples
    --------
    >>> import ifrfit
    >>> ifrfit.fit("cornell-glass", prior={"e_n": ifrfit.Beta(2.0, 2.0)}).constants.e_n.status
    'determined'
    """

    a: float
    b: float
    name: ClassVar[str] = "beta"

    def _wrong(self) -> str:
        return (
            ""
            if min(self.a, self.b) >= 1.0 and max(self.a, self.b) <= _MOST
            else f"both must lie from 1 to {_MOST:g}"
        )

    def moments(self, lower: float, upper: float) -> tuple[float, float]:
        """Mean and sd."""
        if math.isinf(upper):
            raise UsageError(f"{self!r} spreads over a domain, and this one has no upper end. Give bounds.")
        total = self.a + self.b
        share = self.a / total
        sd = math.sqrt(share * (1.0 - share) / (total + 1.0))
        return lower + share * (upper - lower), sd * (upper - lower)

    def log_density(self, value: Array, lower: float, upper: float) -> Array:
        """Log of its density over the domain."""
        from scipy.special import betaln, xlog1py, xlogy

        t = np.clip((np.asarray(value) - lower) / (upper - lower), 0.0, 1.0)
        found = xlogy(self.a - 1.0, t) + xlog1py(self.b - 1.0, -t) - betaln(self.a, self.b)
        return np.asarray(found - math.log(upper - lower))

    @property
    def words(self) -> str:
        """By its name in mathematics: the small letters are those of a restitution."""
        return f"as Beta({self.a:.6g}, {self.b:.6g})"


LAWS: dict[str, type[PriorLaw]] = {
    law.name: law for law in (Normal, TruncatedNormal, HalfNormal, Uniform, LogNormal, Beta)
}


def read_law(text: str) -> PriorLaw:
    """A law as the command line and files have it: ``lognormal:0.1,0.3``.

    Raises
    ------
    UsageError
        For another name, or other numbers than it takes.
    """
    name, _, rest = text.partition(":")
    if name not in LAWS:
        raise UsageError(f"--prior: '{name}' is no law. Choose {', '.join(LAWS)}.")
    wanted = [each.name for each in fields(LAWS[name])]
    try:
        numbers = [float(part) for part in rest.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != len(wanted):
        raise UsageError(f"--prior: {text} takes {name}:{','.join(wanted).upper()}.")
    return LAWS[name](*numbers)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool) and math.isfinite(value)
