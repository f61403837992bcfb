"""Many arms compared: what changed on one of them, and which differ from their twins."""
