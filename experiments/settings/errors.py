"""What an experiment raises for the user to read; each message names the culprit, the place and the fix."""

from segar.errors import SegarError


class ConfigError(SegarError):
    """A setting has a wrong name, type or value."""


class RunFolderError(SegarError):
    """A run folder cannot be used, or something in it cannot be written or read."""


class CheckpointError(SegarError):
    """A checkpoint does not belong to this code, this configuration or this network."""


class TrackingError(SegarError):
    """The tracking store cannot be used; the run folder holds the same figures."""


class TrainingError(SegarError):
    """Training cannot go on, for example because a loss is not finite."""
