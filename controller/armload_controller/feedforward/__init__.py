"""The payload's torque: computed for any control loop, and sent to the drives."""
