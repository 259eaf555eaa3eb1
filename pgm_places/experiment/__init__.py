"""Configured experiments: what a TOML file describes, run and compared."""
