"""How constants are recovered: problem, least squares with a certificate, statuses and facts."""

from ifrfit.inference.api import fit
from ifrfit.inference.comparison import Comparison, compare
from ifrfit.inference.lmfit_bridge import lmfit_model
from ifrfit.inference.result import Estimate, Fact, FitResult
from ifrfit.inference.serialise import load_result
from ifrfit.inference.simulation import Simulation, simulate

__all__ = [
    "Comparison",
    "Estimate",
    "Fact",
    "FitResult",
    "Simulation",
    "compare",
    "fit",
    "lmfit_model",
    "load_result",
    "simulate",
]
