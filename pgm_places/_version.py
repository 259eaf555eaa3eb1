"""The version, in a separate module: packaging reads it without importing the package.

Between releases it is the next one with ``.dev0`` (docs/development.md).
"""

__version__ = "0.5.0.dev0"
