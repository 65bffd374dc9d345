"""Positioning on the graph of a building."""
