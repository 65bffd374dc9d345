"""Lessons of this chapter."""
