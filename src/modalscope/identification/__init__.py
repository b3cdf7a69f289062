"""Floor 3: the table of methods; data in, identification out."""
