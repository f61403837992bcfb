"""Reading and writing files: strict TOML and CSV, the text of TOML values, atomic replacement."""
