"""Checks of arguments, linear algebra, sums over chunks, executors, memory and threads."""
