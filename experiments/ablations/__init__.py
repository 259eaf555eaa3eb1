"""What each part contributes: features, beams, cells, noise, options, training data."""
