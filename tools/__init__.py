"""Programs of the project's own upkeep; no part of the package."""
