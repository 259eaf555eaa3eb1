"""A learned view of the whole floor: a small convolutional network over the map."""
