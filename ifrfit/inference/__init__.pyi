from .comparison.result import Comparison as Comparison
from .io.lmfit import lmfit_model as lmfit_model
from .io.read_result import load_result as load_result
from .result.fit_result import FitResult as FitResult
from .result.types import Estimate as Estimate
from .result.types import Fact as Fact
