"""Groups of the plainest question, fitted many at once in closed form but for the transition."""
