"""The tables of a robot file: their keys, their checks, and the objects that other layers get from them."""
