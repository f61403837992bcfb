"""The live view of a running arm: handed over, served by a process of its own, relayed to clients."""
