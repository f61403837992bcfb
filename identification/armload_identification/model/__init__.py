"""Chain, bodies, regressor and dynamics of an arm and its payload."""
