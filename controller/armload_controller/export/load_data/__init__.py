"""Load data of robot controllers: one maker's format per file."""
