"""Floor 2: shapes, participation, residuals and accuracy of modes."""
