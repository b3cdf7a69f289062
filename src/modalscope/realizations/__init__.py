"""Floor 2: factors and shifts -> models (A, B, C)."""
