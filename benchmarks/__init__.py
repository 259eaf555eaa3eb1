"""Benchmarks: speed compared with other packages and with limits of the hardware."""
