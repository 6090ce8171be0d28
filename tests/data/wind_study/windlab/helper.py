"""What several modules share."""

STRENGTH = 0.5
