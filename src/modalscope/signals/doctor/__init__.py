"""What is wrong with measured data, before anything is identified from them: one list of findings."""

from modalscope.data.notes import Finding
from modalscope.signals.doctor.examine import examine

__all__ = ["Finding", "examine"]
