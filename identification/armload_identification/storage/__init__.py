"""How files are read and written: strict TOML, the text of TOML values, atomic replacement."""
