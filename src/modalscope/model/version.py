"""The version, written once: files and reports say it."""

__all__ = ["VERSION"]

VERSION = "0.1.0"
