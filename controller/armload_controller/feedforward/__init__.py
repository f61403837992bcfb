"""The payload's torque: in a loop of your own, and into the drives."""
