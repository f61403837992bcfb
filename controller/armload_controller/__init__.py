"""The motion: setpoints, limits, cycle, recorder, feed-forward, command line."""
