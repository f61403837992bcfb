"""CiA 402 and CiA 301 without input or output: states, objects, units, messages, device descriptions, bus budget."""
