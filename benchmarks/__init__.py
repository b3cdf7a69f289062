"""Time and memory, measured against other programs."""
