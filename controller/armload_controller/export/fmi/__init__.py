"""Functional Mock-up Units for simulation tools: one version of the standard per file, and the shared parts."""
