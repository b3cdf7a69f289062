"""A grammar of measurement files: a truth first, then a writer that is a product of independent choices, and verdicts on what is read."""
