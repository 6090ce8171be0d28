"""The settings of a run: dataclasses, how Hydra reads them, and the errors that users see."""
