"""Data that ships with the package: a generated building."""
