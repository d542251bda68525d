"""The exact posterior by deterministic quadrature."""

from ifrfit.inference.posterior.evidence import log_evidence as log_evidence
from ifrfit.inference.posterior.integrate import TOLERANCE as TOLERANCE
from ifrfit.inference.posterior.integrate import Posterior as Posterior
from ifrfit.inference.posterior.integrate import explore as explore
