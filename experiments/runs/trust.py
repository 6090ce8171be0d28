"""Which files were written here, and whose code the settings of others may bring in.

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

from segar.errors import naming
from segar.experiments.runs.own_modules import MODULE_PATH, names_in
from segar.experiments.settings import RunFolderError
from segar.support import EVERYTHING, private_cache_folder

SIGNATURE = "# signature: "
TRUSTED = "SEGAR_TRUST"  # packages that the user trusts, separated by commas; * for all


def signed(text: str) -> str:
    """The text of settings with a last line that says that this user wrote it."""
    return f"{text}{SIGNATURE}{_signature(text)}\n"


def settings_of_file(
    path: Path, settings: Mapping[str, Any], trusted: Collection[str] = (), text: str = ""
) -> Mapping[str, Any]:
    """The settings in a file, as far as they may be used: those of this user as they are, and those of others without the
    folders of their modules, unless everything is trusted.

    Args:
        path, settings, text: the file, the data in it, and its content, where that is signed.
        trusted: names of modules or packages, or ``*`` for all; those in ``$SEGAR_TRUST`` are trusted, too.

    Raises:
        RunFolderError: settings of others name Python objects of packages that are not trusted. SEGAR's own are not unless
            the user says so: what the registries have needs no such name.
    """
    content, _, signature = text.rpartition(SIGNATURE)
    allowed = {*trusted, *filter(None, os.environ.get(TRUSTED, "").split(","))}
    if EVERYTHING in allowed or hmac.compare_digest(signature.strip().encode(), _signature(content).encode()):
        return settings
    if outside := {place: name for place, name in names_in(settings) if not name.is_trusted(allowed)}:
        names = ", ".join(f"{name} ({place})" for place, name in outside.items())
        packages = ",".join(sorted({EVERYTHING if name.is_in_file else name.package for name in outside.values()}))
        raise RunFolderError(
            f"{path} was not written by you on this machine, and names code that would be imported: {names}. If you trust"
            f" it, set {TRUSTED}={packages} (segar evaluate, segar benchmark: trust=true)"
        )
    return {key: value for key, value in settings.items() if key != MODULE_PATH}


def _signature(text: str) -> str:
    return hmac.new(_key(), text.encode(), hashlib.sha256).hexdigest()


def _key() -> bytes:
    """The user's key, which is made when it is first asked for; nobody else can read it."""
    with naming("cannot keep the key that signs runs", RunFolderError):
        path = private_cache_folder() / "key"
    try:
        with FileLock(path.with_suffix(".lock")):  # nobody reads a key that another process has not written yet
            if not path.exists():
                with open(os.open(path, os.O_WRONLY | os.O_CREAT, 0o600), "wb") as stream:
                    stream.write(secrets.token_bytes(32))
    except OSError as error:
        raise RunFolderError(f"cannot make {path}, which signs runs: {error.strerror}; set SEGAR_CACHE_DIR") from error
    return path.read_bytes()
