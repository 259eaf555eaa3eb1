"""Plug-ins for pgm_places: a decoder, the m best labellings, and mixtures of Gaussians."""
