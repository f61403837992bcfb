"""The CANopen master while it runs: bus, SYNC, cycle, the servos, taking torque away."""
