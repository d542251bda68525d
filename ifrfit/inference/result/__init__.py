"""What a fit found, as frozen values."""
