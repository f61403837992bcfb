"""The command line `armload`."""
