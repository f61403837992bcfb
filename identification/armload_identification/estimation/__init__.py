"""Least squares, friction columns, prior knowledge, intervals, physical consistency."""
