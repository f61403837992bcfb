"""Simulated arms, their payloads and recordings, and trials over many seeds."""
