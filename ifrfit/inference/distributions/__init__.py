"""Distributions of the constants, whatever method they come from."""
