"""The studio: a map taught in the browser, on this computer alone."""
