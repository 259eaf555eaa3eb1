"""Every method on the same drives, from configuration files."""
