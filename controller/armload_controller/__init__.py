"""The controller: motion, cycle, sessions, analysis, feed-forward, export, command line."""
