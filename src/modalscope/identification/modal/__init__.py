"""Modes of a model: shapes, participation, indicators, pairing."""
