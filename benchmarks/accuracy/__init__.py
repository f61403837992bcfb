"""Accuracy on real currents and simulated arms; `make accuracy` runs all of it."""
