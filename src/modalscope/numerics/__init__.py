"""Below everything, and knowing no modes: checks, linear algebra, sums over chunks, executors, memory and threads."""
