"""What a command about rows asks for: suites, seeds, a method, where its row goes; and the settings that make a row anew."""

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from segar.errors import naming
from segar.experiments.benchmarking.policy_process import SECONDS
from segar.experiments.benchmarking.protocol import BUDGETS, ONNX, PLAYERS, SHIPPED, suites_named
from segar.experiments.benchmarking.row import LONGEST_NAME, NAME, ROW, TRAINED, Method, Row
from segar.experiments.runs.files import absolute_path
from segar.experiments.runs.own_modules import modules_named
from segar.experiments.runs.run_folder import runs_root
from segar.experiments.settings import (
    ConfigError,
    Count,
    LevelCount,
    RunConfig,
    RunFolderError,
    ScaleConfig,
    as_data,
    plain_name,
    require,
    require_known,
    run_config,
)
from segar.suites import TEXTURED, outline
from segar.support import EVERYTHING

ROWS = "benchmark"  # the folder of rows, under the root of runs
NOT_OF_METHOD = ("levels", "evaluation", "seed", "frames")  # parts of a run's identity that differ from piece to piece


@dataclass(frozen=True)
class BenchmarkConfig:
    """The settings of a row, and where it goes."""

    run: RunConfig = field(default_factory=RunConfig)
    suites: tuple[str, ...] = ("core",)
    budget: str = "laptop"
    seeds: Count = 5
    player: str = ""  # one without training, in place of an algorithm
    policy: str = ""  # of a method that was trained elsewhere
    policy_seconds: float = SECONDS
    privileged: bool = False  # the policy plans in the simulator, or knows more than it is given
    actions: str = ""  # folder of files of actions
    training_levels: LevelCount | None = None  # on each suite; None: as many as it says
    row: str = ""
    rows: str | None = None
    verify: tuple[str, ...] = ()
    salt: str = ""
    again: tuple[str, ...] = ()
    trust: bool = False  # import the modules that rows name
    panel: bool = False
    table: bool = False
    processes: int = 0
    dry_run: bool = False
    report: bool = True

    def __post_init__(self) -> None:
        require_known("budget", self.budget, BUDGETS)
        frames, given = BUDGETS[self.budget], self.run.scale.frames
        wanted = f"{frames:,} with budget={self.budget}; with budget=open it says how many" if frames else ""
        require(given in (frames or given, ScaleConfig().frames), "scale.frames", given, wanted)
        require(self.processes >= 0, "processes", self.processes, "0 or more")
        require(0 < self.policy_seconds <= 1e6, "policy_seconds", self.policy_seconds, "above 0, and at most 1e6")
        require(not self.salt or bool(self.verify), "salt", self.salt, "given beside verify=ROW")
        if self.player:
            require_known("algorithm", self.player, PLAYERS)
        for names in (("player", "policy", "actions"), ("verify", "again", "panel", "table")):
            named = [name for name in names if getattr(self, name)]
            one = f"one of {', '.join(names).replace('player', 'algorithm')}"
            require(len(named) < 2, named[-1] if named else "", named, one)
        is_foreign = bool(self.policy or self.actions)
        require(is_foreign or not self.privileged, "privileged", True, "given beside policy or actions")
        own = f"{self.player or 'another name'}: the rows of players have their names, and no others do"
        require(self.row in ("", self.player) if self.player else self.row not in PLAYERS, "row", self.row, own)
        if is_foreign and not self.row:
            raise ConfigError("row: name the row of a method that was trained elsewhere: row=NAME")
        some = "a suite, or several; those of textures show themselves in frames alone, such as observation=rgb"
        of_rows = self.verify or self.again  # which say what they show
        require(bool(suites_named(self.suites) if of_rows else self.chosen_suites()), "suite", list(self.suites), some)
        own_name = "a name of letters, digits, spaces and _ . + -, without folders: rows=FOLDER says where"
        require(not self.row or NAME.fullmatch(self.row) is not None, "row", self.row, own_name)

    @property
    def is_onnx(self) -> bool:
        """Whether the policy is an ONNX file, or a folder of such files, which the row carries."""
        return self.policy.endswith(ONNX) or Path(self.policy or ONNX).is_dir()

    @property
    def trusted(self) -> tuple[str, ...]:
        """The packages and modules whose code rows may bring in: those that the command names itself, or all."""
        return (EVERYTHING,) if self.trust else tuple(modules_named([as_data(self.run), self.policy]))

    @property
    def folder(self) -> Path:
        """The folder of rows."""
        return absolute_path(self.rows) if self.rows else runs_root(self.run) / ROWS

    @property
    def places(self) -> tuple[Path, ...]:
        """The folders in which rows are looked for."""
        return tuple(dict.fromkeys((self.folder, SHIPPED)))

    def chosen_suites(self) -> tuple[str, ...]:
        """The suites to play: those of textures need an agent that sees frames."""
        chosen = suites_named(self.suites)
        shows_textures = self.run.observation.name in {*TEXTURED, *TEXTURED.values()}
        sees_no_textures = not self.player and not self.actions and not shows_textures
        return tuple(name for name in chosen if not (sees_no_textures and outline(name)["textures"]))

    def all_seeds(self) -> range:
        """The seeds."""
        return range(self.run.seed, self.run.seed + self.seeds)

    def trained_run(self) -> RunConfig:
        """The settings that all trainings share."""
        scale, frames = self.run.scale, BUDGETS[self.budget]
        scale = dataclasses.replace(scale, name=self.budget, frames=frames or scale.frames)
        return dataclasses.replace(self.run, scale=scale)


def method_of(config: BenchmarkConfig) -> Method:
    """What the row is of."""
    run = config.trained_run()
    if config.player:
        return Method(config.row or config.player, "player", PLAYERS[config.player])
    settings: dict[str, Any] = {"privileged": True} if config.privileged else {}
    if config.actions:
        return Method(config.row, "actions", "actions of a method that was trained elsewhere", settings=settings)
    if config.policy:
        settings |= {"observation": {"name": run.observation.name, "options": dict(run.observation.options)}}
        if not config.is_onnx:
            settings |= {"policy": config.policy}
        says = f"{'ONNX' if config.is_onnx else config.policy}, trained elsewhere, on {run.observation.name}"
        return Method(config.row, "onnx" if config.is_onnx else "actions", says, settings=settings)
    settings = settings_of(run, config.training_levels)
    curriculum = [] if run.curriculum is None else [run.curriculum.name]
    name = plain_name("-".join([run.algorithm.name, *curriculum, run.observation.name, config.budget]))[:LONGEST_NAME]
    says = f"{run.algorithm.name} on {run.observation.name}, {run.scale.frames:,} frames on each suite with each seed"
    return Method(config.row or name, "networks", says, config.budget, run.scale.frames, settings)


def settings_of(run: RunConfig, training_levels: LevelCount | None = None) -> dict[str, Any]:
    """The settings of a run that all pieces of a row share, as plain data."""
    data = as_data(run, without_later_defaults=True)
    shared = {key: data.get(key, value) for key, value in run.identity().items() if key not in NOT_OF_METHOD}
    return shared | ({"training_levels": training_levels} if training_levels else {})


def again(config: BenchmarkConfig, row: Row) -> list[BenchmarkConfig]:
    """The settings that make a row anew: of each seed, for the suites that were played with it.

    Raises:
        SegarError: its settings are none, or name Python objects that ``config`` does not trust.
    """
    method, settings = row.method, dict(row.settings(config.trusted, TRAINED))
    training_levels = settings.pop("training_levels", None)
    with naming(row.folder / ROW, RunFolderError):
        data = as_data(config.run) | settings
        data |= {"scale": {**data["scale"], "frames": method.frames or data["scale"]["frames"]}}
        whole = dataclasses.replace(
            config, seeds=1, row=method.name, budget=method.budget or config.budget,
            training_levels=training_levels, player=method.name if method.name in PLAYERS else "",
        )  # fmt: skip
        return [
            dataclasses.replace(
                whole,
                run=run_config({**data, "seed": seed}),
                suites=tuple(piece.suite for piece in row.pieces if piece.seed == seed),
            )
            for seed in sorted({piece.seed for piece in row.pieces})
        ]
