"""The master over EtherCAT (CoE), on a network interface of its own."""
