"""Models: each learns its parameters, forms potentials, and calls a solver."""
