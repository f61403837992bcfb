"""Payloads written for other programs: C, FMU and LinuxCNC, URDF and ROS 2, load data of robot controllers."""
