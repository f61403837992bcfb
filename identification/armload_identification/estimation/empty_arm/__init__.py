"""The arm without a payload: its body and friction from its own runs, and a payload by what is known of it."""
