"""State observations: the factors of things as one float32 vector."""
