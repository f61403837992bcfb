"""The robots shipped with armload, as TOML files in this folder."""
