"""The arm itself from its runs: drive gains, body, friction."""
