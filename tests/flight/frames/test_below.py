"""Images in the folders of a card: the flight's frames say which are meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.clicking import write_images
from wildlab.errors import WildlabError
from wildlab.flight.readers.frames import open_frames
from wildlab.flight.readers.frames.below import images_below
from wildlab.replay.shots import read_shots


def card(folder: Path) -> Path:
    write_images(folder / "100CANON", "IMG_1.png", "IMG_2.png", "IMG_9.png")
    write_images(folder / "101CANON", "IMG_3.png")
    write_images(folder / ".trash", "IMG_1.png")
    return folder


def test_frames_are_found_by_their_names_in_any_folder_below(tmp_path):
    there = card(tmp_path / "DCIM")
    for ids in (["IMG_1", "IMG_2", "IMG_3"], ["IMG_1.png", "IMG_2.png", "IMG_3.png"]):
        found = [one.relative_to(there).as_posix() for one in images_below(there, ids)]
        assert found == ["100CANON/IMG_1.png", "100CANON/IMG_2.png", "101CANON/IMG_3.png"]
        assert [one.name for one in open_frames(there, ids=ids).files] == [Path(one).name for one in found]
    assert sorted(read_shots(there, ["IMG_3", "no such", "IMG_1"], None).by_row) == [0, 2]
    assert images_below(there, ["DJI_1"]) == []
    with pytest.raises(WildlabError, match="no images"):
        open_frames(there, ids=["DJI_1"])


def test_of_two_files_of_one_name_nobody_can_tell_the_flights(tmp_path):
    there = card(tmp_path / "DCIM")
    write_images(there / "101CANON", "IMG_2.png", "IMG_9.png")
    assert len(images_below(there, ["IMG_1", "IMG_3"])) == 2
    with pytest.raises(WildlabError, match=r"IMG_2\.png.*100CANON and in 101CANON"):
        open_frames(there, ids=["IMG_1", "IMG_2"])
