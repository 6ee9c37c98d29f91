"""What comes in by the doors is bounded and typed, or refused in a line with file and rule."""

import gzip
import os
from dataclasses import dataclass

import numpy as np
import pytest

from models.schema import (
    VARIABLE,
    InputLimits,
    LimitError,
    Table,
    limits,
    pieces,
    read_bytes,
    read_json,
    read_toml,
    require_name,
)
from tests.refused import line_about


class RefusedError(ValueError):
    """The error that a door is told to raise."""


def refusal(read, path):
    """The one line that a door refuses a file with."""
    message = line_about(path, RefusedError, read, RefusedError)
    assert message.startswith(": ") and len(message) < 300
    return message


@pytest.mark.parametrize("read", [read_bytes, read_json, read_toml])
def test_what_is_no_file_is_refused_before_it_is_opened(read, tmp_path):
    assert "it is a folder" in refusal(read, tmp_path)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)  # opening it would wait for ever
    assert "a device, pipe or socket" in refusal(read, pipe)
    endless = tmp_path / "endless"
    endless.symlink_to("/dev/zero")
    assert "a device, pipe or socket" in refusal(read, endless)
    with pytest.raises(RefusedError, match="absent: there is no such file"):
        read(tmp_path / "absent", RefusedError)


def test_a_large_file_is_refused_unread_and_the_limit_can_be_raised(tmp_path, monkeypatch):
    path = tmp_path / "sparse.toml"
    with path.open("wb") as file:
        file.truncate(10**12)
    assert "megabytes must be at most 0.1, here are 1000000;" in refusal(read_toml, path)
    path.write_text('name = "' + "a\\n" * 10 + '"\n' + "# no more\n" * 20_000)
    said = refusal(read_toml, path)
    assert f"{VARIABLE}=toml=NUMBER" in said
    monkeypatch.setenv(VARIABLE, "toml=1, samples=5")
    assert read_toml(path, RefusedError)["name"].startswith("a\n")
    assert limits() == InputLimits(toml=1.0, samples=5.0)


@pytest.mark.parametrize("words", ["tom=1", "toml", "toml=", "toml=-1", "toml=nan", "toml=1 =2"])
def test_limits_that_are_none_are_refused(monkeypatch, words):
    monkeypatch.setenv(VARIABLE, words)
    with pytest.raises(LimitError, match="must hold NAME=NUMBER of megabytes, samples"):
        limits()


def test_a_gzip_bomb_stops_at_the_limit(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "megabytes=3")
    bomb = gzip.compress(bytes(30_000_000))
    assert len(bomb) < 40_000
    path = tmp_path / "b.gz"
    path.write_bytes(bomb)
    with pytest.raises(RefusedError, match=r"megabytes must be at most 3, here are 3\.1"):
        list(pieces(path, RefusedError, limit="megabytes"))
    path.write_bytes(gzip.compress(b"a" * 1_000_000) + gzip.compress(b"b" * 1_900_000))
    whole = b"".join(pieces(path, RefusedError, limit="megabytes"))
    assert whole == b"a" * 1_000_000 + b"b" * 1_900_000


DOCUMENTS = [
    (read_json, "[" * 90_000, "too deep"),
    (read_json, '{"a":' * 33 + "1" + "}" * 33, "levels of tables and lists must be at most 32"),
    (read_json, '{"a": ' + "9" * 5000 + "}", "read as JSON: a number or date that cannot be"),
    (read_json, "{", "cannot be read as JSON"),
    (read_json, '[{"a": {"b": 1, "c": 2, "b": 1}}]', "as JSON: 'b' is given twice in one"),
    (read_json, "\udcff", "not a text file in UTF-8"),
    (read_toml, "a = " + "[" * 3900, "too deep"),
    (read_toml, "a = " + "[" * 33 + "]" * 33, "levels of tables and lists must be at most 32"),
    (read_toml, ".".join("a" * 1900) + " = 1", "levels of tables and lists must be at most 32"),
    (read_toml, "a = " + "9" * 5000, "characters of a line must be at most 4000, here are 5004"),
    (read_toml, "a = 2026-13-45", "cannot be read as TOML"),
    (read_toml, "a = = 1", "cannot be read as TOML"),
    (read_toml, "mass = 1926,2", "a decimal point, not a comma?"),
]


@pytest.mark.parametrize(("read", "text", "said"), DOCUMENTS)
def test_a_document_that_is_deep_long_or_none_is_refused(tmp_path, read, text, said):
    path = tmp_path / "a"
    path.write_text(text, errors="surrogateescape")
    assert said in refusal(read, path)


def test_values_are_counted(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "values=100")
    path = tmp_path / "a.json"
    path.write_text('{"a": [' + ", ".join("1" * 98) + "]}")
    assert len(read_json(path, RefusedError)["a"]) == 98
    path.write_text('{"a": [' + ", ".join("1" * 99) + "]}")
    assert "values must be at most 100, here are 101" in refusal(read_json, path)


@dataclass(frozen=True, kw_only=True)
class Record:
    """One field of every type that records in files have."""

    name: str = "a"
    count: int
    size: float
    scale: tuple[float, ...] | None = None
    matrix: tuple[tuple[float, float], tuple[float, float]] = ((1.0, 0.0), (0.0, 1.0))


def test_a_record_comes_out_of_a_table_with_its_types():
    data = {"count": 3, "size": 2, "scale": [1, 2.5], "matrix": [[1, 2], [3, 4]]}
    values = Table(data, "f: ", RefusedError).record(Record)
    expected = Record(count=3, size=2.0, scale=(1.0, 2.5), matrix=((1.0, 2.0), (3.0, 4.0)))
    assert Record(**values) == expected
    assert isinstance(values["size"], float)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"size": None}, "f: in.size must be a number, it is None"),
        ({"size": True}, "f: in.size must be a number, it is True"),
        ({"size": "1.0"}, "f: in.size must be a number, it is '1.0'"),
        ({"size": 10**400}, "f: in.size must be a number, it is a whole number of 1329 bits"),
        ({"size": {}}, "f: in.size must be a number, it is a table of 0"),
        ({"count": 1.0}, "f: in.count must be a whole number of 64 bits, it is 1.0"),
        ({"count": 2**63}, "f: in.count must be a whole number of 64 bits"),
        ({"name": 3}, "f: in.name must be a text, it is 3"),
        ({"scale": 3}, "f: in.scale must be a list, it is 3"),
        ({"scale": ["a"]}, "f: in.scale must be a number, it is 'a'"),
        ({"matrix": [[1, 2]]}, "f: in.matrix must be a list of 2, it is a list of 1"),
        ({"color\x1b": 1}, "f: in.color\\x1b is unknown, known are name, count"),
    ],
)
def test_a_wrong_value_is_named_and_shown(change, said):
    data = {"count": 3, "size": 2.0} | change
    with pytest.raises(RefusedError) as caught:
        Table(data, "f: ", RefusedError, "in.").record(Record)
    assert said in str(caught.value)


def test_a_value_that_is_missing_is_named():
    with pytest.raises(RefusedError, match=r"^size is missing$"):
        Table({"count": 1}, "", RefusedError).record(Record)
    with pytest.raises(RefusedError, match="the document must be a table, it is a list of 1"):
        Table([1], "", RefusedError)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ([[1, 2], [3]], "lists of equal length"),
        ([[1, 2], 3], "lists of equal length"),
        ([1.0, float("nan")], "not finite: nan"),
        ([1.0, True], "must be a number"),
        (["1.0"], "must be a number"),
        ([10**400], "must be a number"),
    ],
)
def test_an_array_holds_rows_of_finite_numbers(value, said):
    with pytest.raises(RefusedError, match=said):
        Table({"a": value}, "", RefusedError).array("a")


def test_arrays_keep_their_shape():
    for shape in ((2, 3), (4,), (2, 1, 2), (0,), ()):
        given = np.arange(float(np.prod(shape))).reshape(shape)
        read = Table({"a": given.tolist()}, "", RefusedError).array("a")
        np.testing.assert_array_equal(read, given)
        assert read.shape == shape


@pytest.mark.parametrize("name", [3, None, "a" * 201, "half \ud800"])
def test_what_cannot_be_a_name_is_refused(name):
    with pytest.raises(RefusedError):
        require_name(RefusedError, "name", name)
    require_name(RefusedError, "name", "Käfer \x1b[0m 車")  # shown escaped wherever it goes


def test_a_toml_file_may_begin_with_a_byte_order_mark(tmp_path):
    """As editors on Windows write one."""
    path = tmp_path / "marked.toml"
    path.write_bytes(b"\xef\xbb\xbfmass = 1.0\r\n")
    assert read_toml(path, RefusedError) == {"mass": 1.0}
