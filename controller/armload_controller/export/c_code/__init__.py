"""What `armload export --format c` writes around the straight-line code: templates, self-test, the rate of a change."""
