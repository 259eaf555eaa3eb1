"""Threads, lazy memory, and the common headers of the C++ kernels."""
