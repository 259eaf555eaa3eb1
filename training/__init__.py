"""Training of the floor networks, which labelling does not need."""
