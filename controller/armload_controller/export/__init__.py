"""Payloads written for others: C, FMU and LinuxCNC for loops, URDF and ROS 2, load data of robot controllers."""
