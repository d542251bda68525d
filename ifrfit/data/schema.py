"""The names of the common schema, what each observable can be, and where it is not defined."""

from __future__ import annotations

from dataclasses import dataclass

PROVENANCES = ("measured", "digitised", "simulated", "stand-in")
_PROVENANCE_SPELLINGS = {"digitized": "digitised", "simulation": "simulated", "standin": "stand-in"}

# Ranges that a measurement, a digitisation or a simulation can have. They are wide on purpose: they catch
# slipped units, slipped exponents and placeholder numbers (1e300, -9999 in an angle), not bad measurements.
# RATIO: quantities over |U_t|, sin gamma or cos gamma. Where the denominator is a rounding error (1e-12 is
# refused as undefined, see validate.py) a ratio of ordinary velocities cannot exceed 1e12.
# FREE: velocities and spins per incoming speed. A sphere of 1 m that spins at 1e5 rad/s and drifts at
# 0.1 m/s has 1e6.
RATIO = 1e12
FREE = 1e6
# Nothing that was measured or computed in double precision lies below 1e-60 without being 0: rounding leaves
# 1e-17, a product of three such residues 1e-51.
TINY = 1e-60
SIGMA_RANGE = (1e-15, 1e6)
SPEED_RANGE = (1e-9, 1e5)


@dataclass(frozen=True)
class Observable:
    """One observable of the common schema.

    Attributes
    ----------
    name : str
        As in the column ``observable``.
    unit : str
        ``deg`` or ``1``.
    low, high : float
        Possible range of a value, in `unit`.
    meaning : str
        In words.
    undefined : tuple of str
        Where there is no value: ``contact`` (the contact point does not move, U_t = 0), ``normal`` (gamma =
        0), ``rest`` (gamma = 0 and no spin), ``grazing`` (gamma = 90 degrees).
    takes : frozenset of str
        Which measurements of an impact the value uses up: ``Tx``, ``Ty`` (centre velocity along the wall),
        ``Sx``, ``Sy`` (spin after), ``N`` (normal velocity after).
    with_e_n : bool
        The value is computed with the normal velocity after, although it does not use it up.
    needs_gamma : bool
        A row must give the incidence angle.
    """

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    undefined: tuple[str, ...] = ()
    takes: frozenset[str] = frozenset()
    with_e_n: bool = False
    needs_gamma: bool = True


_T, _S = frozenset({"Tx", "Ty"}), frozenset({"Sx", "Sy"})
_X, _XS = frozenset({"Tx"}), frozenset({"Tx", "Sy"})

# In the order in which they are preferred where the same impacts are given several times: measured velocities
# and spin, then centre plus spin, then what is computed from both.
_ALL = (
    Observable("v_x", "1", -FREE, FREE, "tangential velocity of the centre after, over u", takes=_X),
    Observable(
        "v_y", "1", -FREE, FREE, "lateral velocity of the centre after, over u", takes=frozenset({"Ty"})
    ),
    Observable("v_n", "1", 0.0, 10.0, "normal velocity after (magnitude), over u", takes=frozenset({"N"})),
    Observable("spin_y_after", "1", -FREE, FREE, "R Omega_y/u after", takes=frozenset({"Sy"})),
    Observable("spin_x_after", "1", -FREE, FREE, "R Omega_x/u after", takes=frozenset({"Sx"})),
    Observable(
        "beta_cm", "1", -RATIO, RATIO, "-v_x/u_x: tangential restitution of the centre", ("normal",), takes=_X
    ),
    Observable(
        "e_n",
        "1",
        0.0,
        10.0,
        "-v_z/u_z: normal restitution",
        ("grazing",),
        takes=frozenset({"N"}),
        needs_gamma=False,
    ),
    Observable(
        "beta",
        "1",
        -RATIO,
        RATIO,
        "-V_t/U_t: tangential restitution of the contact",
        ("contact",),
        takes=_T | _S,
    ),
    Observable("tan_psi_after", "1", -RATIO, RATIO, "V_x over the incoming u_z", ("grazing",), takes=_XS),
    Observable(
        "psi_after_deg", "deg", -90.0, 90.0, "atan of V_x over the incoming u_z", ("grazing",), takes=_XS
    ),
    Observable(
        "tan_psi_out", "1", -RATIO, RATIO, "V_x over the outgoing |v_z|", ("grazing",), _XS, with_e_n=True
    ),
    Observable(
        "psi_out_deg",
        "deg",
        -90.0,
        90.0,
        "atan of V_x over the outgoing |v_z|",
        ("grazing",),
        _XS,
        with_e_n=True,
    ),
    Observable(
        "mu_app", "1", -RATIO, RATIO, "P_x/P_n: apparent friction", ("grazing",), takes=_X, with_e_n=True
    ),
    Observable(
        "delta_deg",
        "deg",
        -90.0,
        90.0,
        "atan of v_x over |v_z|: rebound angle",
        ("grazing",),
        _X,
        with_e_n=True,
    ),
    Observable("beta_tot", "1", 0.0, FREE, "|v|/u: total restitution", takes=_T, with_e_n=True),
    Observable("lambda_deg", "deg", -180.0, 180.0, "atan2(v_y, v_x): turn of the path", ("rest",), takes=_T),
    Observable("mu", "1", 0.0, 100.0, "friction coefficient, measured directly", needs_gamma=False),
)
OBSERVABLES: dict[str, Observable] = {o.name: o for o in _ALL}


def provenance_name(text: str) -> str | None:
    """Return the provenance that `text` names, or None if it names none; empty stays empty (not stated)."""
    name = text.strip().lower().replace("_", "-")
    name = _PROVENANCE_SPELLINGS.get(name.replace("-", ""), name)
    return name if name in PROVENANCES or not name else None
