"""A comparison of closures as text, figure and folder."""
