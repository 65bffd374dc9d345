"""Estimation and geometry for positioning: numpy and scipy only, pure functions, no input or output."""
