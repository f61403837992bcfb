"""The commands that open an arm's bus."""
