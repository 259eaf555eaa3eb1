"""Threads, memory in pages, and the headers that all kernels in C++ share."""
