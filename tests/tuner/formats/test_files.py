"""Result files are whole or absent; JSON has no NaN."""

import json

import numpy as np
import pytest

from tuner.formats.documents import json_text
from tuner.formats.files import whole_file, write_text


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
