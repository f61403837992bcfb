"""Comparison with other programs on the same tasks; these run in a separate environment."""
