"""Arithmetic that runs per sample or per cycle, and the type of its arrays; imports only numpy."""
