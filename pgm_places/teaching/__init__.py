"""Teaching a labeler by painting: paint, labels that follow it, and where to look next."""
