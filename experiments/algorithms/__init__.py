"""The algorithms: each a learner behind one protocol."""
