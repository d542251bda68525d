"""Closures: what each model of contact takes for the tangential impulse.

Most are a pair (a, b) in ``k = a + min(b, kappa U_n/|U_t|)``, where -k U_t is the tangential impulse per
mass: `Coefficients`, linear in the closure's own constant. Any other `Law` is fitted by general roads.
A further closure is one more entry of `CLOSURES`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ifrfit.physics.compliance.law import Compliance, chi_range
from ifrfit.physics.impulse_laws import Coefficients as Coefficients
from ifrfit.physics.impulse_laws import Law
from ifrfit.registry import Registry


@dataclass(frozen=True)
class Closure:
    """One model of the tangential impulse.

    Attributes
    ----------
    name : str
        As on the command line.
    title : str
        As in reports.
    constant : str or None
        Name of the constant beside e_n and mu, if it has one.
    law : callable
        Inertia factor J to the `Law` of the impulse.
    domain : callable
        J to the passive range of the constant (theory: no kinetic energy is created).
    source : str
        Where the closure comes from.
    """

    name: str
    title: str
    constant: str | None
    law: Callable[[float], Law]
    domain: Callable[[float], tuple[float, float]]
    source: str

    @property
    def constants(self) -> tuple[str, ...]:
        """Names of all constants, in the order of results."""
        return ("e_n", self.constant, "mu") if self.constant else ("e_n", "mu")

    def __reduce__(self) -> tuple[Callable[[str], Closure], tuple[str]]:
        return get_closure, (self.name,)  # to other processes by its name: its functions cannot go there

    @property
    def bilinear(self) -> bool:
        """Whether the law is linear in the constants in either regime."""
        return isinstance(self.law(0.4), Coefficients)

    def coefficients(self, inertia_factor: float) -> Coefficients:
        """The bilinear law.

        Raises
        ------
        TypeError
            If the closure's law is another one: see `bilinear`.
        """
        law = self.law(inertia_factor)
        if not isinstance(law, Coefficients):
            raise TypeError(f"closure {self.title} is not bilinear")
        return law


def rotational_share(inertia_factor: float) -> float:
    """J/(1 + J): the impulse that stops the contact point, per mass and slip (2/7 for a solid sphere)."""
    return inertia_factor / (1.0 + inertia_factor)


def _brach(j: float) -> Coefficients:
    return Coefficients(0.0, 0.0, rotational_share(j), 0.0)


def _walton(j: float) -> Coefficients:
    share = rotational_share(j)
    return Coefficients(0.0, 0.0, share, share)


def _ifr(j: float) -> Coefficients:
    share = rotational_share(j)
    return Coefficients(share, share, j, 0.0)


def _ifr_contact(j: float) -> Coefficients:
    share = rotational_share(j)
    return Coefficients(share, share, share, 0.0)


_DOMENECH = "Doménech-Carbó (2023), Eqs (19)-(22) with the signs of the impulses corrected"

CLOSURES: Registry[Closure] = Registry(
    "closure",
    Closure,
    (
        Closure("f", "F", None, _brach, lambda j: (0.0, 0.0), "Brach (1984), J. Appl. Mech. 51, 164"),
        Closure(
            "fr",
            "FR",
            "beta0",
            _walton,
            lambda j: (-1.0, 1.0),
            "Walton (1993), in Particulate Two-Phase Flow, 884",
        ),
        Closure("ifr", "IFR", "e_t", _ifr, lambda j: (-1.0, -j), _DOMENECH),
        Closure(
            "ifr-contact",
            "IFR-contact",
            "e_t",
            _ifr_contact,
            lambda j: (-1.0, 0.0),
            _DOMENECH + ", with the impulse that stops the contact point as friction in sticking",
        ),
        Closure(
            "maw",
            "MAW",
            "chi",
            lambda j: Compliance(rotational_share(j)),
            chi_range,
            "Maw, Barber & Fawcett (1976), Wear 38, 101; e_n < 1 by the scaling of Wu, Thornton & Li (2003), "
            "Adv. Powder Technol. 14, 435",
        ),
    ),
)


def get_closure(name: str) -> Closure:
    """Look a closure up by name.

    Raises
    ------
    UsageError
        If there is none of that name; the message lists those there are.
    """
    return CLOSURES[name.lower()]
