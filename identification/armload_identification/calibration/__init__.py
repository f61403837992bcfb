"""Calibration of an arm from its runs: drive gains, body, friction."""
