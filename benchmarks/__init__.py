"""Benchmarks of time and accuracy, compared with other programs; `make bench` runs those of time."""
