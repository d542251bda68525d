"""The question of a fit: rows, parameters, noise and error model, and the values that they predict."""
