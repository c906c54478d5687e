"""Result files are whole or absent; JSON has no NaN."""

import json

import numpy as np
import pytest

from tuner.formats.documents import json_text
from tuner.formats.file_set import write_set
from tuner.formats.files import inputs_kept, keep_input, whole_file, write_text
from tuner.formats.guard import input_guard
from tuner.types.records import DataError


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")

    def fail():
        with whole_file(path) as temporary:
            temporary.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_nan_becomes_null_and_arrays_become_lists():
    text = json_text({"a": np.array([1.0, np.nan]), "b": (np.float64("inf"), np.int64(3)), 5: "°"})
    assert json.loads(text) == {"a": [1.0, None], "b": [None, 3], "5": "°"}


def test_no_input_of_a_command_is_written_over(tmp_path):
    """Named at the start or read on the way, by whatever name it is written; afterwards it is a file like any other."""
    named, read, link = tmp_path / "named.csv", tmp_path / "read.json", tmp_path / "link.csv"
    for path in (named, read):
        path.write_text("data")
    link.symlink_to(named)
    with inputs_kept([named, tmp_path / "absent"]):
        with input_guard(read, "JSON"):
            pass
        for path in (named, link, read, tmp_path / "." / "named.csv"):
            with pytest.raises(
                DataError, match=r"expected another file to write, found an input of this command"
            ):
                write_text(path, "result")
        with pytest.raises(DataError, match=r"read\.json: expected another file"):
            write_set(tmp_path, {"a.txt": b"1", "read.json": b"{}"}, last="read.json")
        write_text(tmp_path / "absent", "result")
    assert (named.read_text(), read.read_text()) == ("data", "data")
    assert not (tmp_path / "a.txt").exists()
    keep_input(named)
    write_text(named, "result")
    assert named.read_text() == "result"
