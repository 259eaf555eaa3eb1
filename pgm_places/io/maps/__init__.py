"""Maps as files: map_server, images, labels and regions as ground truth."""
