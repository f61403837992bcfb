"""Whole runs over EtherCAT, beside CANopen's."""
