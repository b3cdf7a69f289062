"""Realizations: factors and shifts to models (A, B, C)."""
