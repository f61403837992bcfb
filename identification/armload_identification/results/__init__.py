"""Results as their users hold them: one object with payload, verdict, table, dictionary, file and report."""
