"""The settings of a run: dataclasses in which every default lives once, and the errors that users see.

It may import segar. For authors of algorithms: a sub-class of :class:`AlgorithmConfig`, or of an algorithm's own class such
as :class:`PPOConfig`, holds the settings of an algorithm of your own, and names the class that learns.
"""

from experiments.settings.algorithms import (
    KINDS,
    AlgorithmConfig,
    AuxiliaryConfig,
    CURLConfig,
    DrQConfig,
    OffPolicyConfig,
    PPOConfig,
    RecurrentPPOConfig,
    SACConfig,
    SPRConfig,
    added_later,
    kind_of,
)
from experiments.settings.checks import (
    TARGET_DESIGN,
    import_object,
    require,
    require_design,
    require_known,
    require_seed,
)
from experiments.settings.construct import construct, flat, path_of
from experiments.settings.errors import CheckpointError, ConfigError, RunFolderError, TrackingError, TrainingError
from experiments.settings.evaluate import EvaluateConfig
from experiments.settings.from_data import run_config
from experiments.settings.grid import (
    DIFFICULTIES,
    Cell,
    cell_config,
    cell_of,
    design,
    design_hash,
    paper_cells,
    paper_seeds,
)
from experiments.settings.release_0_1 import TYPE_IS_GONE, label_in_0_1, with_new_names
from experiments.settings.run import (
    ACTION_MODES,
    CHECKOUT,
    EvaluationConfig,
    LevelsConfig,
    ObservationConfig,
    RunConfig,
    ScaleConfig,
    TaskConfig,
    TrackingConfig,
    as_data,
)

__all__ = [
    "ACTION_MODES",
    "CHECKOUT",
    "DIFFICULTIES",
    "KINDS",
    "TARGET_DESIGN",
    "TYPE_IS_GONE",
    "AlgorithmConfig",
    "AuxiliaryConfig",
    "CURLConfig",
    "Cell",
    "CheckpointError",
    "ConfigError",
    "DrQConfig",
    "EvaluateConfig",
    "EvaluationConfig",
    "LevelsConfig",
    "ObservationConfig",
    "OffPolicyConfig",
    "PPOConfig",
    "RecurrentPPOConfig",
    "RunConfig",
    "RunFolderError",
    "SACConfig",
    "SPRConfig",
    "ScaleConfig",
    "TaskConfig",
    "TrackingConfig",
    "TrackingError",
    "TrainingError",
    "added_later",
    "as_data",
    "cell_config",
    "cell_of",
    "construct",
    "design",
    "design_hash",
    "flat",
    "import_object",
    "kind_of",
    "label_in_0_1",
    "paper_cells",
    "paper_seeds",
    "path_of",
    "require",
    "require_design",
    "require_known",
    "require_seed",
    "run_config",
    "with_new_names",
]
