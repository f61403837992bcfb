"""Reduction of long recordings while they are read: period averages, or means over 10 ms."""
