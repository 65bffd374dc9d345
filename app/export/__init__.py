"""Pictures, figures and data without anyone at a browser."""
