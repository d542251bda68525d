"""Rebounds of a scene, with only the effects that it calls for."""
