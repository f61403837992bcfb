"""Time and memory; `make bench` runs all of it."""
