"""The closures there are.

A further one is a file of its own and one more entry of `CLOSURES`, or comes by `ifrfit.register`. Nothing
else in the package knows the names of closures or of their constants.
"""

from __future__ import annotations

import copyreg
from dataclasses import replace

from ifrfit.physics.closure import Closure, ClosureConstant, Meaning, check_closure, rotational_share
from ifrfit.physics.compliance.law import HIGHEST_CHI, LOWEST_CHI, Compliance, chi_range, poisson_ratio
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.registry import Registry


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


def _maw(j: float) -> Compliance:
    return Compliance(rotational_share(j))


_DOMENECH = "Doménech-Carbó (2023), Eqs (19)-(22) with the signs of the impulses corrected"

_BETA0 = ClosureConstant(
    "beta0", r"\beta_0", "restitution of the contact point in sticking", lambda j: (-1.0, 1.0)
)
_E_T = ClosureConstant("e_t", "e_t", "tangential restitution", lambda j: (-1.0, -j))
_CHI = ClosureConstant(
    "chi",
    r"\chi",
    "compliance number, 7 (1 - nu)/(2 (2 - nu)) for a solid sphere of the wall's material",
    chi_range,
    limits=(LOWEST_CHI, HIGHEST_CHI),
    limits_words="the table of closure MAW",
    advice="a solid sphere of the wall's material has 7/6 to 7/4",
    meaning=Meaning(
        "poisson_ratio",
        "nu",
        "Poisson ratio, if sphere and wall are of one material",
        lambda chi, j: float(poisson_ratio(chi, j)),
    ),
)

CLOSURES: Registry[Closure] = Registry(
    "closure",
    Closure,
    (
        Closure(
            "f",
            "F",
            _brach,
            "Brach (1984), J. Appl. Mech. 51, 164",
            full_title="friction alone",
            references=("brach1984",),
        ),
        Closure(
            "fr",
            "FR",
            _walton,
            "Walton (1993), in Particulate Two-Phase Flow, 884",
            _BETA0,
            full_title="friction and restitution",
            references=("walton1993",),
        ),
        Closure(
            "ifr",
            "IFR",
            _ifr,
            _DOMENECH,
            _E_T,
            full_title="independent friction and restitution",
            references=("domenech2023",),
        ),
        Closure(
            "ifr-contact",
            "IFR-contact",
            _ifr_contact,
            _DOMENECH + ", with the impulse that stops the contact point as friction in sticking",
            replace(_E_T, domain=lambda j: (-1.0, 0.0)),
            full_title="independent friction and restitution; in sticking friction stops the contact point",
            references=("domenech2023",),
        ),
        Closure(
            "maw",
            "MAW",
            _maw,
            "Maw, Barber & Fawcett (1976), Wear 38, 101; e_n < 1 by the scaling of Wu, Thornton & Li (2003), "
            "Adv. Powder Technol. 14, 435",
            _CHI,
            regimes=("partial slip", "gross slip"),
            effect="compliance",
            full_title="Maw, Barber and Fawcett: elastic compliance of the contact",
            references=("maw1976", "wu2003"),
            caveat="Closure MAW is an elastic solution, scaled to e_n < 1: another rule moves the contact "
            "velocity by up to 0.09 (e_n = 0.95) or 0.17 (e_n = 0.9) of mu U_n/khat; see docs/compliance.md.",
        ),
    ),
    check=check_closure,
)


def get_closure(name: str) -> Closure:
    """Look a closure up by name.

    Raises
    ------
    UsageError
        If there is none of that name; the message lists those there are.
    """
    return CLOSURES[str(name).lower()]


# to other processes by its name: its functions cannot go there
copyreg.pickle(Closure, lambda closure: (get_closure, (closure.name,)))
