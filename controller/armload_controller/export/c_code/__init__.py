"""The text that `armload export --format c` writes around the straight-line code: templates, self-test, change rate."""
