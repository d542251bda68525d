"""The figures of the paper: what each shows, its curves and points as numbers, and the drawing."""
