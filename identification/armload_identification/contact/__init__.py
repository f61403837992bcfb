"""Load or push: whether something acts on a calibrated arm that its payload does not explain, and what it is."""
