"""Checks of recordings and results: sanity, validation, comparison, notes to the operator."""
