"""Global least squares with a certificate."""
