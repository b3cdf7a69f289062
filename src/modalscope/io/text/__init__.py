"""Delimited text, by evidence: dialect, layout, columns."""

from modalscope.io.text.reader import TEXT_OPTIONS, read

__all__ = ["TEXT_OPTIONS", "read"]
