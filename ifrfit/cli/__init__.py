"""The command line: one module a command, each a call of the library."""
