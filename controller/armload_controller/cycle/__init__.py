"""The control cycle: plug-ins, monitors, recorder, the gate for added torque, and the table of stops."""
