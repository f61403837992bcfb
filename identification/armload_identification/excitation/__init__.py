"""Fourier excitations: criterion, search, and the limits that a motion must keep."""
