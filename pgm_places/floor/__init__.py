"""The floor network: a small convolutional network that labels the complete map."""
