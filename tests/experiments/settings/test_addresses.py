"""Addresses: files with odd names, and passwords, which stand in no file and are found again in the environment."""

import os
import sqlite3
from pathlib import Path

import pytest
import sqlalchemy
from hypothesis import given
from hypothesis import strategies as st

from segar.experiments.settings import hand_on_password, sqlite_address, with_password, without_password

WORD = st.text("abcXYZ019._~-%!$", min_size=1, max_size=8)


@given(WORD, st.text("abc019@:%!$", min_size=1, max_size=8).map(lambda text: f"x{text}"), WORD)
def test_a_password_never_stands_in_what_is_written(user, password, host):
    address = f"postgresql+psycopg2://{user}:{password}@{host}:5432/mlflow"
    assert without_password(address) == f"postgresql+psycopg2://{user}@{host}:5432/mlflow"
    assert password not in without_password(f"cannot open {address}: 401 ").replace(user, "").replace(host, "")


@pytest.mark.parametrize(
    "address",
    [
        "http://host:5000",
        "http://host:5000/path@x",
        "https://me@host/x",
        "sqlite:////a:b@c/mlflow.db",
        "http://[::1]:5000/",
    ],
)
def test_an_address_without_a_password_stays_as_it_is(address):
    assert without_password(address) == address


@pytest.mark.parametrize(
    ("address", "variable"),
    [
        ("postgresql+psycopg2://me:s%40cret@host/db", "PGPASSWORD"),
        ("https://me:s%40cret@host/mlflow", "MLFLOW_TRACKING_PASSWORD"),
        ("mysql+pymysql://me:s%40cret@host/db", "MYSQL_PWD"),
    ],
)
def test_a_password_that_is_handed_on_is_put_in_again(address, variable, monkeypatch):
    monkeypatch.delenv(variable, raising=False)
    written = hand_on_password(address)
    assert "cret" not in written
    assert os.environ[variable] == "s@cret"
    assert with_password(written) == address
    assert with_password(address) == address
    monkeypatch.delenv(variable)
    assert with_password(written) == written


@pytest.mark.parametrize("name", ["a b", "a%20b", "100%", "a?b=c", "a#b", "häß", "a&b;c@d:e"])
def test_the_address_of_a_file_is_that_of_this_file_alone(tmp_path, name):
    folder = tmp_path / name
    folder.mkdir()
    engine = sqlalchemy.create_engine(sqlite_address(folder / "some.db"))
    with engine.begin() as connection:
        connection.execute(sqlalchemy.text("CREATE TABLE there (n INTEGER)"))
    engine.dispose()
    with sqlite3.connect(folder / "some.db") as direct:
        assert direct.execute("SELECT name FROM sqlite_master").fetchall() == [("there",)]
    direct.close()
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_an_ordinary_path_has_the_address_that_it_always_had():
    assert sqlite_address(Path("/data/my runs/mlflow.db")) == "sqlite:////data/my runs/mlflow.db"
