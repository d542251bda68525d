"""Constants out: what the contact model of a simulator takes, in its own syntax."""
