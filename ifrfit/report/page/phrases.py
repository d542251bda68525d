"""Small words that several sections share."""

from __future__ import annotations

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics import OBSERVABLES
from ifrfit.report.provenance import is_stand_in

_KEPT = {*OBSERVABLES, "e_t", "beta0", "chi", "chi2", "kappa"}


def sentence(says: str) -> str:
    """A finding as a sentence: with a full stop, and a capital unless a quantity's name comes first."""
    first = says.partition(" ")[0].rstrip(",:;")
    shown = says if first in _KEPT else f"{says[:1].upper()}{says[1:]}"
    return f"{shown.rstrip('.')}."


def stand_in_words(result: FitResult) -> str:
    """What stands before every caption of generated data; empty for data proper."""
    return "STAND-IN data, not an experiment. " if is_stand_in(result) else ""
