"""Recordings of many arms: identified in parallel on Dask, stored as Parquet, assessed together."""
