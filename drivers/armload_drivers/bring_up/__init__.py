"""The CANopen master before and beside the cycle: scan, boot, configure, check and inspect drives by SDO."""
