"""Reports as single HTML pages, for readers who were not present at the measurement."""
