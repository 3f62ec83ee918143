import io

import numpy as np
import pytest

from nichechain.core.errors import NichechainError
from nichechain.core.unfinished import read_unfinished, write_unfinished

MADE_BY = {"seed": 3, "niches": {"shape": (4, 5)}}


def test_what_was_written_comes_back(tmp_path):
    path = tmp_path / "new" / "kept"
    assert read_unfinished(path, MADE_BY, "births", "states") is None
    assert read_unfinished(None, MADE_BY, "births", "states") is None
    write_unfinished(path, MADE_BY, {"states": np.arange(7)})
    found = read_unfinished(path, MADE_BY, "births", "states")
    np.testing.assert_array_equal(found["states"], np.arange(7))


def test_what_others_made_is_refused(tmp_path):
    path = tmp_path / "kept"
    write_unfinished(path, MADE_BY, {"states": np.arange(7)})
    with pytest.raises(NichechainError, match="holds births that differ in seed: start over, or remove it"):
        read_unfinished(path, {**MADE_BY, "seed": 4}, "births", "states")


def _npz(**arrays):
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"something else",
        _npz(made_by=np.array("{}")),
        _npz(made_by=np.array("{"), a=np.zeros(2), b=np.zeros(2)),
        _npz(made_by=np.array("{}"), a=np.zeros(2), b=np.zeros(3)),
        _npz(made_by=np.array("{}"), a=np.array(1), b=np.zeros(3)),
        _npz(made_by=np.array("{}"), a=np.array([{}], object), b=np.zeros(1)),
    ],
)
def test_damaged(tmp_path, content):
    path = tmp_path / "kept"
    path.write_bytes(content)
    with pytest.raises(NichechainError, match="is damaged, remove it"):
        read_unfinished(path, {}, "births", "a", "b")
