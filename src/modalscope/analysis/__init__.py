"""Whole jobs: a test analysed, compared, certified, and followed over months."""
