"""Whole runs over CANopen: stops, false alarms, bus faults, what feed-forward achieves."""
