"""Recordings of many arms: identified in parallel on Dask, kept as Parquet, judged together."""
