"""A robot file for an arm that has none: from its URDF or from answers, its drives from the bus or a description."""
