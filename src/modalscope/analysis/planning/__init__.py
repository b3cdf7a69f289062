"""What to measure: places of sensors and forces before a test, and what lowers the deviations of its modes next."""
