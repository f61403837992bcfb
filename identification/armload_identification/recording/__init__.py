"""Recordings: the one type, its readers, and which rows are garbage."""
