"""Recordings: their common type, its readers, and the detection of invalid rows."""
