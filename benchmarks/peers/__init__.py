"""The same work by this library and by other programs, each in an environment of its own."""
