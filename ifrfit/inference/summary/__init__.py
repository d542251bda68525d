"""Estimates, intervals and statuses of constants, and of what follows from them."""
