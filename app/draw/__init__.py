"""Scene items become a few kinds of primitive that the renderer sends: pure functions, no viser."""
