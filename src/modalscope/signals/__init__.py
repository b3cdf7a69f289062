"""Records to responses, and what is wrong with data."""
