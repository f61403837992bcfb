"""Cyclic data of an arm's drives: units, frames, offsets."""
