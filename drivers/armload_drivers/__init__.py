"""The servos: CANopen, CiA 402, the interface `JointServos` and its fakes."""
