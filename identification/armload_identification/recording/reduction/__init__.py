"""Long recordings made short while they are read: period averages, or means over 10 ms."""
