"""What is known about a level distribution without sampling: marginals, log-probabilities, entropy."""
