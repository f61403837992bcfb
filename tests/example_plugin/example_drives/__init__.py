"""Profiles of drives: `profile = "example_servo"` in a robot's file."""
