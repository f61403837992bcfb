"""Functional Mock-up Units, for tools that simulate: one version of the standard per file, and what they share."""
