"""Payloads written for others: C for a control loop, URDF and ROS 2, load data of robot controllers."""
