"""Results for users: objects with payload, verdict, table, dictionary, file and report."""
