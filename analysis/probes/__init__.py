"""What a representation knows of the true factors: pairs collected frame by frame, and several ways to ask."""

from segar.analysis.probes.information import mine_accuracy

__all__ = ["mine_accuracy"]
