"""Analyse a test from a path to a result, certify the result, and repeat the analysis from its document."""
