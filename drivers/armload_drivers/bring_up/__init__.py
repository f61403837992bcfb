"""The CANopen master before and outside the cycle: scan, boot, configure, check and inspect drives by SDO."""
