"""The likelihood of modes: noise models, descent, refinement, standard deviations."""
