"""From recordings to a payload with its intervals."""
