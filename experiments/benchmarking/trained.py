"""The piece of a row that a finished run makes: its network as plain data, and the episodes of that network."""

import dataclasses
from pathlib import Path

from segar.envs import VectorEnv
from segar.experiments.algorithms.portable import network_of
from segar.experiments.benchmarking.level_sets import hashes_of, number_of_levels, plays_twins, sets_of
from segar.experiments.benchmarking.playing import play_file
from segar.experiments.benchmarking.row import Method, NewPiece, Piece, read_piece, write_piece
from segar.experiments.collection.collector import observation_shape
from segar.experiments.commands import process_defaults as runtime
from segar.experiments.evaluation.evaluator import load_agent, options_of
from segar.experiments.runs.executed_code import files_of_code
from segar.experiments.runs.run_folder import EVALUATIONS, folder_path, read_versions
from segar.experiments.settings import RunConfig
from segar.policies import NETWORK_FILE, Network
from segar.suites import Suite, suite

PIECE = "benchmark"  # in the evaluations of a run
MOST_WEIGHTS = 40_000  # that stay float32; those of larger networks are rounded to 16 bits, for files of half the size


def piece_of(run: RunConfig, method: Method) -> NewPiece:
    """The piece of a finished run, played and written unless it is there for this version of the suite."""
    runtime.set_process_defaults(run.num_threads)
    folder, of = folder_path(run), suite(run.levels.train)
    place = folder / EVALUATIONS / PIECE
    found = read_piece(place)
    if found is not None and (found.piece.suite_hash, found.piece.run) == (of.hash, run.label()):
        return found
    network, bits = rounded(network_in(folder, run, of))
    place.mkdir(parents=True, exist_ok=True)
    network.save(place / NETWORK_FILE)
    sets = sets_of(of, run.levels.seed, number_of_levels(method), plays_twins(method))
    episodes = play_file(place / NETWORK_FILE, of, method, sets, run.seed)
    piece = Piece(of.name, of.hash, run.seed, hashes_of(sets), run.label(), NETWORK_FILE, bits, made_with(folder))
    write_piece(place, piece, episodes)
    return NewPiece(piece, episodes, place / NETWORK_FILE)


def network_in(folder: Path, run: RunConfig, of: Suite) -> Network:
    """The network of the run's agent, with nothing but what its actions depend on."""
    policy, _ = load_agent(folder, run, of.test_levels, print)
    options = options_of(folder, run)
    env = VectorEnv(of.test_levels, 1, seed=0, **options)
    network = network_of(policy, observation_shape(env), options["task"])
    env.close()
    last = max(network.mean, network.log_std)
    return dataclasses.replace(network, layers=network.layers[: last + 1], value=None)


def rounded(network: Network) -> tuple[Network, int]:
    """A network whose file is small, and the bits of its weights."""
    weights = sum(array.size for layer in network.layers for array in layer.arrays.values())
    return (network, 32) if weights <= MOST_WEIGHTS else (network.in_float16(), 16)


def made_with(folder: Path) -> dict[str, object]:
    """Libraries, commit, arithmetic and the user's own files by which the run in a folder was trained."""
    found = read_versions(folder)
    own = files_of_code(found.get("code", {}))
    kept = {name: found[name] for name in ("python", "libraries", "git", "arithmetic") if name in found}
    return {**kept, **({"code": own} if own else {})}
