"""Label graphs: nodes, edges, edge kinds and layouts."""
