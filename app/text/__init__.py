"""Words and formulas become HTML that needs nothing from the network."""
