"""What few need, shipped and tested, but out of the way: it registers by the entry points of plug-ins (pyproject.toml)."""
