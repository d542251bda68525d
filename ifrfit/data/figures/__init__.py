"""Points read off figures: project files of digitisers, and what a click's error does to their values."""
