"""Map files: map_server's format, images, and ground truth as label images or regions."""
