"""Measured tests that come with the program, with what is known of their modes, for first trials and for examples."""

from modalscope.datasets.shipped import describe, folder, load, names, reference

__all__ = ["describe", "folder", "load", "names", "reference"]
