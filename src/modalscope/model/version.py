"""The version, as files and reports say it; a test holds it to that of the face and of the project file."""

__all__ = ["VERSION"]

VERSION = "0.2.0"
