"""The sections of a report, one file a section: each a function from `Material` to a `Section` or None."""
