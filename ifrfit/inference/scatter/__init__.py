"""How measured values scatter about the model, beyond independent Gaussian errors of the values."""

from ifrfit.inference.scatter.law import PLAIN as PLAIN
from ifrfit.inference.scatter.law import Scatter as Scatter
