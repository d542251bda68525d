"""Profiles: of each constant, of kappa, of the restitution in sticking, of the transition angle."""
