"""Floor 1: block data matrices and their factors."""
