"""Units that end the names of a scene's numbers, as in diameter_mm."""

from __future__ import annotations

from ifrfit.errors import UsageError

# (multiplier, divisor) to SI: 30 um is 30/1e6, the double nearest to 3e-5, so that equal conditions in
# different units are equal to the last bit
_Factor = tuple[float, float]
UNITS: dict[str, dict[str, _Factor]] = {
    "length": {"m": (1, 1), "cm": (1, 1e2), "mm": (1, 1e3), "um": (1, 1e6), "nm": (1, 1e9)},
    "mass": {"kg": (1, 1), "g": (1, 1e3), "mg": (1, 1e6), "ug": (1, 1e9)},
    "speed": {"m_s": (1, 1), "cm_s": (1, 1e2), "mm_s": (1, 1e3), "km_s": (1e3, 1)},
    "rate": {"rad_s": (1, 1), "rpm": (3.141592653589793, 30.0)},
    "angle": {"deg": (1, 1), "rad": (180.0, 3.141592653589793)},
    "pressure": {"Pa": (1, 1), "kPa": (1e3, 1), "MPa": (1e6, 1), "GPa": (1e9, 1)},
    "density": {"kg_m3": (1, 1), "g_cm3": (1e3, 1)},
    "energy per area": {"J_m2": (1, 1), "mJ_m2": (1, 1e3)},
    "time": {"s": (1, 1), "ms": (1, 1e3), "us": (1, 1e6), "ns": (1, 1e9)},
    "viscosity": {"Pa_s": (1, 1), "mPa_s": (1, 1e3)},
    "number": {"": (1, 1)},
}


def dimension_of(unit: str) -> str:
    """What a unit measures, as "pressure" for "GPa"; "number" for the empty one.

    Raises
    ------
    UsageError
        For a unit that is none of `UNITS`.
    """
    for dimension, units in UNITS.items():
        if unit in units:
            return dimension
    known = ", ".join(each for units in UNITS.values() for each in units if each)
    raise UsageError(f"There is no unit '{unit}'. Choose one of {known}.")


def names(base: str, dimension: str) -> list[str]:
    """Every name that a number can have, as diameter_m, diameter_mm."""
    return [f"{base}_{unit}" if unit else base for unit in UNITS[dimension]]


def to_si(value: float, name: str, base: str, dimension: str) -> float:
    """Convert a number by the unit at the end of its name; angles to degrees."""
    multiplier, divisor = UNITS[dimension][name.removeprefix(base).removeprefix("_")]
    return value * multiplier / divisor
