"""Whether the model describes the data, and which constants the data determine."""
