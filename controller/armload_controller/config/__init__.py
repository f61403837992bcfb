"""The robot file: tables, checks, and the `Robot` made from it."""
