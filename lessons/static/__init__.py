"""Lessons on static positioning: MAT chapter 2."""
