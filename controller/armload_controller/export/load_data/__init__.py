"""Load data of robot controllers: one manufacturer's format per file."""
