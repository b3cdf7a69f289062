"""The written result: one self-contained HTML file that can be sent to anybody."""

from modalscope.interfaces.reporting.document import report

__all__ = ["report"]
