"""The drives of an arm while cycles run, on either bus: their states, stops, and the removal of torque."""
