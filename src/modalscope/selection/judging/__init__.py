"""Which poles of a stabilization diagram are modes, and how far to trust them."""
