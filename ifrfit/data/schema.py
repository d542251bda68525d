"""Ranges and words of the common schema; what each observable can be is in `ifrfit.physics.observables`."""

from __future__ import annotations

STAND_IN = "stand-in"
PROVENANCES = ("measured", "digitised", "simulated", STAND_IN)
_PROVENANCE_SPELLINGS = {"digitized": "digitised", "simulation": "simulated", "standin": "stand-in"}

# Nothing that was measured or computed in double precision lies below 1e-60 without being 0: rounding leaves
# 1e-17, a product of three such residues 1e-51.
TINY = 1e-60
SIGMA_RANGE = (1e-15, 1e6)
SPEED_RANGE = (1e-9, 1e5)


def provenance_name(text: str) -> str | None:
    """Return the provenance that `text` names, or None if it names none; empty stays empty (not stated)."""
    name = text.strip().lower().replace("_", "-")
    name = _PROVENANCE_SPELLINGS.get(name.replace("-", ""), name)
    return name if name in PROVENANCES or not name else None
