"""Simulated CiA 402 drives on a CAN bus, with the plant behind them."""
