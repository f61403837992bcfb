"""Paths, phase, setpoints, and the limits and obstacles that they are checked against."""
