"""The CANopen master during cycles: the cycle, the servos, removal of torque."""
