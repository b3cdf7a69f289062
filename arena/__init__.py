"""The arena: programs that identify modes, on tests of real and simulated structures, with one score for all."""
