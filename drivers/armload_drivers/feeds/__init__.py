"""Joints that other software publishes: ROS 2 over DDS, and the controllers of Universal Robots over RTDE."""
