"""A payload by armload. Arguments: loaded and unloaded CSV. Prints the same JSON as the peers' programs."""

import json
import sys

import armload

found = armload.identify("ur10e", *sys.argv[1:]).payload
low, high = found.interval_95[0]
body = {"mass_kg": found.model.mass_kg, "center_m": found.model.center_of_mass_m.tolist()}
body |= {"inertia_kg_m2": found.model.inertia_about_com.tolist(), "half_width_kg": (high - low) / 2.0}
print(json.dumps(body))
