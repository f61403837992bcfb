"""One bus as the master uses it: sending and receiving, SYNC, SDO, and who is there."""
