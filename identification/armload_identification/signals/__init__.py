"""Motion and joint torque of a run, and the difference of two runs."""
