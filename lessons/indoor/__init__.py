"""Lessons on indoor positioning with a floor graph: the GBPF thesis."""
