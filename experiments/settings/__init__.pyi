from .addresses import (
    hand_on_password as hand_on_password,
    scheme as scheme,
    sqlite_address as sqlite_address,
    with_password as with_password,
    without_password as without_password,
)
from .algorithms import (
    KINDS as KINDS,
    TARGET as TARGET,
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
)
from .checks import (
    DESIGNS as DESIGNS,
    ENDLESS as ENDLESS,
    MATCHED_DESIGNS as MATCHED_DESIGNS,
    RULE_SETS_DESIGN as RULE_SETS_DESIGN,
    TARGET_DESIGN as TARGET_DESIGN,
    Count,
    CountFrom0,
    LevelCount as LevelCount,
    NotNegative,
    Positive,
    PositiveOrNull,
    Seed as Seed,
    Settings as Settings,
    Share,
    Widths,
    one_of,
    path_of as path_of,
    require as require,
    require_design as require_design,
    require_known as require_known,
    require_seed as require_seed,
    that,
)
from .curricula import (
    CURRICULA as CURRICULA,
    NO_CURRICULUM as NO_CURRICULUM,
    SCORES as SCORES,
    ACCELConfig,
    CurriculumConfig,
    PLRConfig,
    ReplayConfig as ReplayConfig,
    RobustPLRConfig,
    SFLConfig,
    UniformConfig,
)
from .errors import CheckpointError, ConfigError, RunFolderError, TrackingError, TrainingError
from .evaluate import EvaluateConfig
from .from_data import construct as construct, flat as flat, run_config as run_config
from .grid import (
    GridPoint as GridPoint,
    config_at as config_at,
    design as design,
    design_hash as design_hash,
    grid_point as grid_point,
    panel_parts as panel_parts,
)
from .imported_sources import imported_from as imported_from
from .own_code import (
    add_module_path as add_module_path,
    class_behind as class_behind,
    class_named as class_named,
    import_object as import_object,
    is_level_file as is_level_file,
    level_file as level_file,
    name_of_target as name_of_target,
    require_members as require_members,
    without_files as without_files,
    without_folder as without_folder,
)
from .run import (
    ACTION_MODES as ACTION_MODES,
    DEFAULT_TASK as DEFAULT_TASK,
    DIFFICULTIES as DIFFICULTIES,
    OWN_TASK as OWN_TASK,
    TRACKERS as TRACKERS,
    ActionMode as ActionMode,
    Design as Design,
    Difficulty as Difficulty,
    EvaluationConfig,
    Family as Family,
    LevelsConfig,
    ObservationConfig,
    RunConfig,
    ScaleConfig,
    TaskConfig,
    TrackingConfig,
    as_data as as_data,
    is_distribution as is_distribution,
    named_distributions as named_distributions,
)
from .yaml_text import read_yaml as read_yaml

__all__ = [
    "ACCELConfig", "AlgorithmConfig", "AuxiliaryConfig", "CURLConfig", "CheckpointError", "ConfigError", "Count",
    "CountFrom0", "CurriculumConfig", "DrACConfig", "DrQConfig", "EvaluateConfig", "EvaluationConfig", "LevelsConfig",
    "NotNegative", "ObservationConfig", "OffPolicyConfig", "PLRConfig", "PPGConfig", "PPOConfig", "Positive",
    "PositiveOrNull", "RecurrentPPOConfig", "RobustPLRConfig", "RunConfig", "RunFolderError", "SACConfig", "SFLConfig",
    "SPRConfig", "ScaleConfig", "Share", "TaskConfig", "TrackingConfig", "TrackingError", "TrainingError",
    "UniformConfig", "Widths", "added_later", "one_of", "that",
]  # fmt: skip
