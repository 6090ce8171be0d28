"""Which run folders were made here, and whose code the settings of others may bring in.

The settings of a run may name modules of its author's. Reading a run imports them, so a folder from somebody else could run any
code. The settings are therefore signed with a key of this user's own, which is made once and lies beside the compiled kernels.
"""

import hashlib
import hmac
import os
import secrets
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from filelock import FileLock

from experiments.runs.own_modules import OURS, modules_named
from experiments.settings import RunFolderError
from segar.errors import SegarError
from segar.support import private_cache_folder

SIGNATURE = "# signature: "
TRUSTED = "SEGAR_TRUST"  # packages that the user trusts, separated by commas; * for all
EVERYTHING = "*"


def signed(text: str) -> str:
    """The text of settings with a last line that says that this user wrote it."""
    return f"{text}{SIGNATURE}{_signature(text)}\n"


def require_trust(path: Path, text: str, settings: Mapping[str, Any], trusted: Collection[str] = ()) -> None:
    """Raises :class:`RunFolderError` if settings that this user did not write name modules of packages that are not trusted.

    Args:
        path, text, settings: the file, its content, and the data in it.
        trusted: names of modules or packages, or ``*`` for all; those in ``$SEGAR_TRUST`` are trusted, too.
    """
    content, _, signature = text.rpartition(SIGNATURE)
    if hmac.compare_digest(signature.strip(), _signature(content)):
        return
    allowed = {*trusted, *filter(None, os.environ.get(TRUSTED, "").split(",")), *OURS}
    outside = sorted(
        {name for name in modules_named(settings) if not {name, name.partition(".")[0], EVERYTHING} & allowed}
    )
    if outside:
        packages = sorted({name.partition(".")[0] for name in outside})
        raise RunFolderError(
            f"{path} was not written by you on this machine, and names code that would be imported: {', '.join(outside)}."
            f" If you trust it, set {TRUSTED}={','.join(packages)} (experiments.evaluate: trust=true)"
        )


def _signature(text: str) -> str:
    return hmac.new(_key(), text.encode(), hashlib.sha256).hexdigest()


def _key() -> bytes:
    """The user's key, which is made when it is first asked for; nobody else can read it."""
    try:
        path = private_cache_folder() / "key"
    except SegarError as error:
        raise RunFolderError(f"cannot keep the key that signs runs: {error}") from error
    try:
        with FileLock(path.with_suffix(".lock")):  # nobody reads a key that another process has not written yet
            if path.exists() and path.stat().st_uid != os.geteuid():
                path.unlink()  # planted while others could write to the folder
            if not path.exists():
                with open(os.open(path, os.O_WRONLY | os.O_CREAT, 0o600), "wb") as stream:
                    stream.write(secrets.token_bytes(32))
    except OSError as error:
        raise RunFolderError(f"cannot make {path}, which signs runs: {error.strerror}; set SEGAR_CACHE_DIR") from error
    return path.read_bytes()
