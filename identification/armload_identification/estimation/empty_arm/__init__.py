"""The arm without a payload: its body and friction from its own runs, and a payload fitted on a known arm."""
