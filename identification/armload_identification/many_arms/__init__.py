"""Many arms side by side: what changed on one of them, and which differ from their twins."""
