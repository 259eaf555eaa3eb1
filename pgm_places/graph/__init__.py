"""The graph that everything is labelled on: nodes, edges, edge kinds and layouts."""
