"""Faster forms of steps of an identification: each gives what the plain step of the same name gives, which its test shows."""
