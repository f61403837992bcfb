"""The robots armload ships, as TOML files beside this one."""
