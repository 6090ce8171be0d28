"""Trained policies by name: those of the rows of the benchmark, from a checkout or fetched by their hash."""

from pathlib import Path

from segar.errors import SegarError, did_you_mean
from segar.policies.network import Network
from segar.policies.network_policy import NetworkPolicy
from segar.support import RESULTS, ROWS, fetch_published, read_manifest


def load(row: str, suite: str, seed: int = 1, *, sampled: bool = False, results: Path | None = None) -> NetworkPolicy:
    """The policy that a row of the benchmark has for a suite, which acts without torch.

    >>> agent = segar.policies.load("ppo_fast-state-laptop", "place-few-v1")
    >>> agent.act(np.zeros(agent.network.observation_shape, np.float32)).shape
    (2,)

    Args:
        row: name of a row of the leaderboard, such as ``ppg_fast-state-laptop``. suite: name of a suite, with its version.
        seed: of the training. The clone has seed 1 of some suites; others are fetched from the address in
            ``SEGAR_RESULTS_URL``, checked, and kept in ``results``.
        sampled: as in :class:`NetworkPolicy`.
        results: a folder with a manifest; None means ``docs/results`` of the clone.

    Raises:
        SegarError: no such policy is published, or it is not here and cannot be fetched.
    """
    name, results = f"{ROWS.name}/{row}/{suite}-s{seed}.npz", results or RESULTS
    here = {path.relative_to(results).as_posix() for path in (results / ROWS.name).glob("*/*-s*.npz")}
    published = {one.path: one for one in read_manifest(results)}
    if name not in here:
        if name not in published:
            known = [one for one in {*here, *published} if one.startswith(f"{ROWS.name}/") and one.endswith(".npz")]
            raise SegarError(f"no policy is published as {name} in {results}.{did_you_mean(name, known)}")
        fetch_published(published[name], results)
    return NetworkPolicy(Network.load(results / name), sampled=sampled)
