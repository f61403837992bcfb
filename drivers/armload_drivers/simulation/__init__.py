"""The simulated arm: MuJoCo plant, servo loops, servos without a bus. The master never imports it."""
