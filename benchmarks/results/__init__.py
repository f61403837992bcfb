"""Errors, bounds and verdicts of many trials."""
