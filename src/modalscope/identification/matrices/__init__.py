"""Block data matrices and their factors."""
