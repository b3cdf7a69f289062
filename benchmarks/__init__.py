"""Time and memory, measured against other programs; and, in `exports` and `records`, what makes the data of the studies."""
