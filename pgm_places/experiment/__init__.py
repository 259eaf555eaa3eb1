"""Configured experiments: described by a TOML file, run and compared."""
