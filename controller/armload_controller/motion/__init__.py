"""Paths, phase, setpoints, constraints, and the check that a path must pass before an arm moves."""
