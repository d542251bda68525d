"""Slips of the hand in a table: wrong signs, angles, scales and missing numbers, tried before any effect."""
