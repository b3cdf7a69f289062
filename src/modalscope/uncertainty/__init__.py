"""How far identified values may be from the truth: what the noise leaves open, and what repeated parts of a measurement disagree by."""
