"""Addresses of stores: those of SQLite files wherever they lie, and passwords, which are written nowhere.

A password that an address holds is handed on in the variable of the environment that the kind of store has for it. Whoever
reads the address out of a file takes the password from there.
"""

import os
import re
from pathlib import Path
from urllib.parse import quote, unquote

from segar.experiments.settings.errors import ConfigError

# ``://user:password@host``; not ``://host:5000/path@x``.
PASSWORD = re.compile(r"(://[^:/@\s]*):(?!\d+(?:[/?#\s]|$))(\S*?)@(?=[^@/\s]*(?:[/?#\s'\"]|$))")
USER_ALONE = re.compile(r"(://[^:/@\s]+)@")
VARIABLES = {  # of the environment, for the password of each kind of store
    "http": "MLFLOW_TRACKING_PASSWORD",
    "https": "MLFLOW_TRACKING_PASSWORD",
    "postgresql": "PGPASSWORD",
    "mysql": "MYSQL_PWD",
    "mssql": "SQLCMDPASSWORD",
}
QUOTED = "%?#"  # characters of a path that mean something in an address


def scheme(address: str) -> str:
    """The scheme of an address without the driver: ``postgresql`` for ``postgresql+psycopg2://...``."""
    return address.partition("://")[0].partition("+")[0]


def without_password(text: str) -> str:
    """An address, or a text with addresses, without the passwords in them."""
    return PASSWORD.sub(r"\1@", text)


def with_password(address: str) -> str:
    """An address of a user without a password, with the one that the environment has for this kind of store, if any."""
    password = os.environ.get(VARIABLES.get(scheme(address), ""), "")
    if not password or PASSWORD.search(address):
        return address
    return USER_ALONE.sub(lambda found: f"{found[1]}:{quote(password, safe='')}@", address, count=1)


def hand_on_password(address: str) -> str:
    """The address without its password, which goes into this process's environment, for it and those that it starts."""
    found = PASSWORD.search(address)
    variable = VARIABLES.get(scheme(address))
    if found is None or variable is None:
        return address
    os.environ[variable] = unquote(found[2])
    return without_password(address)


def sqlite_address(path: Path) -> str:
    """The address of an SQLite file, whatever characters its path has.

    Raises:
        ConfigError: the installed SQLAlchemy has no address for this path.
    """
    if not {*str(path)} & {*QUOTED}:
        return f"sqlite:///{path}"
    from sqlalchemy import URL, make_url

    # With a driver's name, MLflow makes no folder that is called like the quoted path.
    address = URL.create("sqlite+pysqlite", database=str(path)).render_as_string()
    if make_url(address).database != str(path):
        raise ConfigError(
            f"root: this version of SQLAlchemy has no address for {path}; install 2.1, or choose another root"
        )
    return address
