"""The version of this package, said here alone: hatchling puts it into what is installed."""

__version__ = "0.3.0"
