"""Other programs on the same tasks, side by side; they run in an environment of their own."""
