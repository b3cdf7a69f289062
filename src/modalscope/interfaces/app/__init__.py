"""The page: one screen from a file to modes that can be defended, served to a browser of this machine; no mathematics."""
