"""Methods that are shipped and tested, but out of the way: they register by the entry points of plug-ins (pyproject.toml)."""
