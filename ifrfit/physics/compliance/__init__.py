"""Tangential compliance: impacts in which the contact slips in part and springs back."""

from ifrfit.physics.compliance.law import chi_of as chi_of
from ifrfit.physics.compliance.law import poisson_ratio as poisson_ratio
from ifrfit.physics.compliance.solvers import METHODS as METHODS
from ifrfit.physics.compliance.solvers import rebound_ratio as rebound_ratio
