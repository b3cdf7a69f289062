"""Numbers that others published, and whether this installation gives them again."""
