"""Files of graphical models that other programs read and write: UAI."""
