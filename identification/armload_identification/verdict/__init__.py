"""Verdicts on results: agreement, tolerance, comparison, notes to the operator; `recording_checks` for recordings."""
