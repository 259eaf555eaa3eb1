"""Compiling, caching, vector instructions and threads: the only code that imports numba."""
