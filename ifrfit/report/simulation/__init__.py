"""A simulation as text, figure and folder."""
