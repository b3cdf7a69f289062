"""The whole job: from a path to a result, and the same again from its document."""
