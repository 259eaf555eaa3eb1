"""Files of topological maps, and exports to other formats."""
