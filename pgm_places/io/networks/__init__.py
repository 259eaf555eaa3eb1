"""Exchange formats of graphical models: UAI."""
