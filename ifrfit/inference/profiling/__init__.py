"""Profiles: of each constant, of kappa, of the restitution in sticking, of the transition angle."""

from ifrfit.inference.profiling.all import profile_all, profiled_estimates
from ifrfit.inference.profiling.converged import profile_converged
from ifrfit.inference.profiling.profile import Profile

__all__ = ["Profile", "profile_all", "profile_converged", "profiled_estimates"]
