"""Names of quantities that each series may have for itself: "mu", or "mu[series]"."""

from __future__ import annotations

from collections.abc import Collection


def entry_name(name: str, series: str = "") -> str:
    """Name of a quantity in a series: "mu[series]"; "mu" where no series is given."""
    return f"{name}[{series}]" if series else name


def split_name(name: str) -> tuple[str, str]:
    """The quantity and the series of a name: "mu[a]" is "mu" and "a", "mu" is "mu" and nothing."""
    quantity, _, rest = name.partition("[")
    return quantity, rest.removesuffix("]")


def quantity_of(name: str) -> str:
    """The quantity of a name, whatever the series."""
    return split_name(name)[0]


def name_in(names: Collection[str], quantity: str, series: str) -> str:
    """Name of a quantity in a series: its own there, or the one that all series share."""
    own = entry_name(quantity, series)
    return own if own in names else quantity
