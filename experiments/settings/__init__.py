"""The settings of a run: dataclasses in which every default lives once, and the errors that users see.

It may import segar. For authors of algorithms: a sub-class of :class:`AlgorithmConfig`, or of an algorithm's own class such
as :class:`PPOConfig`, holds the settings of an algorithm of your own, and names the class that learns.
"""

from segar.experiments.settings.addresses import (
    hand_on_password,
    scheme,
    sqlite_address,
    with_password,
    without_password,
)
from segar.experiments.settings.algorithms import (
    KINDS,
    TARGET,
    AlgorithmConfig,
    AuxiliaryConfig,
    CURLConfig,
    DrACConfig,
    DrQConfig,
    OffPolicyConfig,
    PPGConfig,
    PPOConfig,
    RecurrentPPOConfig,
    SACConfig,
    SPRConfig,
    added_later,
    kind_of,
)
from segar.experiments.settings.checks import (
    DESIGNS,
    ENDLESS,
    MATCHED_DESIGNS,
    RULE_SETS_DESIGN,
    TARGET_DESIGN,
    Count,
    CountFrom0,
    LevelCount,
    NotNegative,
    Positive,
    PositiveOrNull,
    Seed,
    Settings,
    Share,
    Widths,
    one_of,
    path_of,
    require,
    require_design,
    require_known,
    require_seed,
    that,
)
from segar.experiments.settings.curricula import (
    CURRICULA,
    NO_CURRICULUM,
    SCORES,
    ACCELConfig,
    CurriculumConfig,
    PLRConfig,
    ReplayConfig,
    RobustPLRConfig,
    SFLConfig,
    UniformConfig,
)
from segar.experiments.settings.errors import CheckpointError, ConfigError, RunFolderError, TrackingError, TrainingError
from segar.experiments.settings.evaluate import EvaluateConfig
from segar.experiments.settings.from_data import construct, flat, run_config
from segar.experiments.settings.grid import GridPoint, config_at, design, design_hash, grid_point, panel_parts
from segar.experiments.settings.imported_sources import imported_from
from segar.experiments.settings.own_code import (
    add_module_path,
    class_behind,
    class_named,
    import_object,
    is_level_file,
    level_file,
    name_of_target,
    require_members,
    without_files,
    without_folder,
)
from segar.experiments.settings.run import (
    ACTION_MODES,
    DEFAULT_TASK,
    DIFFICULTIES,
    OWN_TASK,
    TRACKERS,
    WORKSPACE,
    ActionMode,
    Design,
    Difficulty,
    EvaluationConfig,
    Family,
    LevelsConfig,
    ObservationConfig,
    RunConfig,
    ScaleConfig,
    TaskConfig,
    TrackingConfig,
    as_data,
    is_distribution,
    named_distributions,
)
from segar.experiments.settings.yaml_text import read_yaml

__all__ = [
    "ACCELConfig", "AlgorithmConfig", "AuxiliaryConfig", "CURLConfig", "CheckpointError", "ConfigError", "Count",
    "CountFrom0", "CurriculumConfig", "DrACConfig", "DrQConfig", "EvaluateConfig", "EvaluationConfig", "LevelsConfig",
    "NotNegative", "ObservationConfig", "OffPolicyConfig", "PLRConfig", "PPGConfig", "PPOConfig", "Positive",
    "PositiveOrNull", "RecurrentPPOConfig", "RobustPLRConfig", "RunConfig", "RunFolderError", "SACConfig", "SFLConfig",
    "SPRConfig", "ScaleConfig", "Share", "TaskConfig", "TrackingConfig", "TrackingError", "TrainingError",
    "UniformConfig", "Widths", "added_later", "one_of", "that",
]  # fmt: skip
