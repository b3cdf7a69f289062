"""Functions of poles on lines and samples, and least squares with them."""
