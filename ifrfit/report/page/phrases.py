"""Small words that several sections share."""

from __future__ import annotations

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics import CLOSURES, OBSERVABLES
from ifrfit.report.provenance import is_stand_in


def sentence(says: str) -> str:
    """A finding as a sentence: with a full stop, and a capital unless a quantity's name comes first."""
    first = says.partition(" ")[0].rstrip(",:;")
    constants = (closure.constant for closure in CLOSURES.values())
    shown = says if first in {*OBSERVABLES, *constants, "chi2", "kappa"} else f"{says[:1].upper()}{says[1:]}"
    return f"{shown.rstrip('.')}."


def stand_in_words(result: FitResult) -> str:
    """What stands before every caption of generated data; empty for data proper."""
    return "STAND-IN data, not an experiment. " if is_stand_in(result) else ""
