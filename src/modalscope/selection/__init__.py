"""Which poles are modes, and how sure: noise, likelihood, standard deviations, grades."""
