"""Floor 2: what noise does to poles."""
