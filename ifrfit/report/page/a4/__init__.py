"""A report on sheets of A4: text, tables and the places of figures, one after another."""
