"""Arms that are watched while they move, over ROS 2, and pushed."""
