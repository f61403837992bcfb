"""The bus as used by the master: sending and receiving, SYNC, SDO, and the scan for nodes."""
