"""The exact posterior by deterministic quadrature."""

from ifrfit.inference.posterior.evidence import log_evidence as log_evidence
from ifrfit.inference.posterior.explore import TOLERANCE as TOLERANCE
from ifrfit.inference.posterior.explore import Posterior as Posterior
from ifrfit.inference.posterior.explore import explore as explore
