"""Delimited text, by evidence: dialect, layout, columns."""

from modalscope.io.text.reader import TEXT_OPTIONS, contents_of_lines, read

__all__ = ["TEXT_OPTIONS", "contents_of_lines", "read"]
