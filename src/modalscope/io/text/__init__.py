"""Delimited text, by evidence: dialect, layout, columns."""

from modalscope.io.text.reader import contents_of_lines, read

__all__ = ["contents_of_lines", "read"]
