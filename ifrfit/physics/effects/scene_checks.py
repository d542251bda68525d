"""What a scene asks for and what it gives, checked against each other."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Literal

from ifrfit.errors import DataError
from ifrfit.physics.effects.contact import Impacts
from ifrfit.physics.effects.registry import EFFECTS

Requested = Literal["auto"] | tuple[str, ...]


def check_requested(requested: Requested, given: Mapping[str, str], obstacles: Mapping[str, str]) -> None:
    """Refuse a list that asks for what cannot be computed.

    Parameters
    ----------
    requested : "auto" or tuple of str
    given : mapping
        ``e_n``, ``tangential``, to the names of the constants that stand for them.
    obstacles : mapping
        Effect to what stands in its way, empty where nothing does.

    Raises
    ------
    DataError
        If a listed effect cannot be computed, or computes what a constant gives.
    """
    for name in requested if requested != "auto" else ():
        constant = given.get(EFFECTS[name].replaces)
        if constant is not None:
            raise DataError(f"effects lists {name}, which computes what {constant} gives. Remove one.")
        if obstacles[name]:
            raise DataError(f"effects lists {name}, but {obstacles[name]}. Change that, or take {name} off.")


def check_closure(impacts: Impacts, obstacles: Mapping[str, str]) -> None:
    """Refuse a closure without its constant where compliance cannot take its place.

    Raises
    ------
    DataError
    """
    if impacts.constant is None and obstacles["compliance"]:
        raise DataError(
            f"constants.{impacts.closure.constant} is missing, and compliance cannot take its place: "
            f"{obstacles['compliance']}."
        )


def check_restitution(laws: Collection[str], requested: Requested, given: Mapping[str, str]) -> None:
    """Refuse anything but one law of e_n, or a constant.

    Parameters
    ----------
    laws : collection of str
        Effects that can compute e_n.

    Raises
    ------
    DataError
    """
    chosen = [name for name in laws if requested == "auto" or name in requested]
    if "e_n" in given or len(chosen) == 1:
        return
    if chosen:
        raise DataError(
            f"e_n could be computed by {' or '.join(chosen)}, and their losses are not known together. "
            "List one of them in effects, or give constants.e_n."
        )
    raise DataError(
        "constants.e_n is missing, and nothing computes it. Give it, or what one of "
        f"{', '.join(n for n, e in EFFECTS.items() if e.replaces == 'e_n')} needs."
    )
