"""Whether recordings can be used: mistakes in columns and units, torque that no arm has, too little motion."""
