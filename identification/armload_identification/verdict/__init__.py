"""Whether recordings and results can be trusted: sanity, validation, comparison, notes."""
