"""Time and accuracy beside the peers'; `make bench` runs them all."""
