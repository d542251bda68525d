"""The quantities that are asked of each group, by their place in arrays."""

E_N, OWN, MU, KAPPA = range(4)  # OWN is the closure constant
