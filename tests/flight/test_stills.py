"""Image files named one by one, or by their folder."""

import pytest

from wildlab.errors import WildlabError
from wildlab.flight.readers.stills import still_files


def test_folders_are_read_in_order_and_once(tmp_path):
    for name in ("b.png", "a.JPG", "c.txt", "a.tif"):
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "d.png").mkdir()
    found = still_files([tmp_path, tmp_path / "b.png"])
    assert [one.name for one in found] == ["a.JPG", "a.tif", "b.png"]


def test_what_is_not_there_and_an_empty_folder_are_sentences(tmp_path):
    with pytest.raises(WildlabError, match="no such file"):
        still_files([tmp_path / "none.png"])
    with pytest.raises(WildlabError, match="no images"):
        still_files([tmp_path])
