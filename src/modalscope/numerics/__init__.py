"""Checks of arguments, linear algebra, sums over chunks, executors, progress, memory and threads."""
