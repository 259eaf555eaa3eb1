"""Compiling, machine code on disk, vector instructions, threads: all that imports numba."""
