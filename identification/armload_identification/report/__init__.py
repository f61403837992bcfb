"""The report: an identification as one HTML page, for a reader who was not present."""
