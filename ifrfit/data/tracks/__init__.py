"""Tracks of balls, frame by frame: impacts, velocities and spins before and after, with their errors."""
