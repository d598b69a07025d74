"""Import and the files around it: links, encodings, clocks that change, folders that are there already."""

from __future__ import annotations

from typing import Any

import pytest

from wildlab.errors import WildlabError
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.store import load_flight


def test_a_link_out_of_the_source_folder(raw: Any) -> None:
    path = raw.write()
    (raw.folder / "secret.csv").write_text(raw.tables["nav.csv"])
    (raw.folder / "raw" / "nav.csv").unlink()
    (raw.folder / "raw" / "nav.csv").symlink_to(raw.folder / "secret.csv")
    with pytest.raises(WildlabError, match="leaves the folder"):
        import_flight(path, raw.folder / "raw", raw.into)
    assert not raw.into.exists()


def test_an_hour_that_is_there_twice(raw: Any) -> None:
    raw.set("time.zone", "Europe/Oslo")
    raw.set("time.epoch", None)
    raw.recipe["truth"].pop()
    for name in ("nav.csv", "photos.csv"):
        raw.tables[name] = raw.tables[name].replace("2024-06-12T09", "2024-10-27T02").replace("Z", "")
    with pytest.raises(WildlabError, match="exists twice"):
        raw.run()
    raw.set("time.zone", "+02:00")
    assert str(raw.run().manifest.time.epoch) == "2024-10-27 00:30:00+00:00"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("id,lat\nbøye,1\n".encode("latin-1"), "line 2 is not UTF-8"),
        (b'id,lat\n"buoy' + b"x" * 200_000, "field larger"),
    ],
)
def test_what_is_not_a_table_of_text(raw: Any, content: bytes, said: str) -> None:
    path = raw.write()
    (raw.folder / "raw" / "buoy.csv").write_bytes(content)
    with pytest.raises(WildlabError, match=said):
        import_flight(path, raw.folder / "raw", raw.into)
    assert not raw.into.exists()


def test_no_source_folder_and_no_recipe(raw: Any) -> None:
    path = raw.write()
    with pytest.raises(WildlabError, match="no such folder"):
        import_flight(path, raw.folder / "nowhere", raw.into)
    with pytest.raises(WildlabError, match="no such file"):
        import_flight(raw.folder / "nothing.toml", None, raw.into)


def test_a_flight_that_is_there_stays(raw: Any) -> None:
    raw.run()
    raw.set("description", "second")
    with pytest.raises(WildlabError, match="already"):
        raw.run()
    assert load_flight(raw.into).manifest.description == ""
    flight = import_flight(raw.write(), raw.folder / "raw", raw.into, overwrite=True)
    assert flight.manifest.description == "second"
    with pytest.raises(WildlabError, match="holds other things"):
        import_flight(raw.write(), raw.folder / "raw", raw.folder / "raw", overwrite=True)


def test_names_of_columns_cannot_command_a_terminal(raw: Any) -> None:
    raw.replace("clicks.csv", "x,y,what", "\x1b[2J,y,what")
    with pytest.raises(WildlabError) as caught:
        raw.run()
    assert "\x1b" not in str(caught.value)
    assert "'\\x1b[2J'" in str(caught.value)


def test_a_wide_table_does_not_fill_the_screen(raw: Any) -> None:
    wide = ",".join(f"column{i}" for i in range(5000))
    raw.tables["clicks.csv"] = f"{wide}\n{',' * 4999}\n"
    with pytest.raises(WildlabError, match=r"\.\.\.") as caught:
        raw.run()
    assert len(str(caught.value)) < 1500
