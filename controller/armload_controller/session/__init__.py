"""Sessions with an arm: opening it, commissioning, feed-forward comparison."""
