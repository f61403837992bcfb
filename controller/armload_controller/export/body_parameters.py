"""The payload as parameters that a user sets, with inertia about the centre of mass instead of the origin.

The C function `theta_of` (`c_code/theta_of.c.in`) converts them, in this order, to the ten parameters theta.
"""

from __future__ import annotations

PARAMETERS = (
    ("mass", "kg", "mass"),
    *((f"com_{axis}", "m", f"centre of mass, {axis} in the flange frame") for axis in "xyz"),
    *((f"i{axis}{axis}", "kg.m2", f"moment of inertia about {axis} through the centre of mass") for axis in "xyz"),
    *((f"i{a}{b}", "kg.m2", f"-int {a} {b} dm about the centre of mass") for a, b in ("xy", "xz", "yz")),
)
"""Name, unit and meaning of the payload's parameters, in the order of its `values`."""
FRICTION = "friction that the payload causes in the gears, added to its torque"
"""Meaning of a calibrated arm's parameter `friction`, which is a share of this."""
TRANSITION_S = 0.5
"""Initial value of the duration of a payload change."""
