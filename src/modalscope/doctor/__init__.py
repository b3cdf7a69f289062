"""What is wrong with measured data, before anything is identified from them: one list of findings."""

from modalscope.doctor.examine import examine
from modalscope.doctor.findings import Finding

__all__ = ["Finding", "examine"]
