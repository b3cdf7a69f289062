"""Whether results hold: certificates, validation with records kept apart, published numbers recomputed."""
