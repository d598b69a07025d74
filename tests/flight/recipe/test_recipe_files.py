"""Import and the files around it: links, encodings, clocks that change, folders that are there already."""

from __future__ import annotations

import pytest

from wildlab.errors import WildlabError
from wildlab.flight.recipe.importing import import_flight
from wildlab.flight.store import load_flight


def test_a_link_out_of_the_source_folder(raw):
    path = raw.write()
    (raw.folder / "secret.csv").write_text(raw.tables["nav.csv"])
    (raw.folder / "raw" / "nav.csv").unlink()
    (raw.folder / "raw" / "nav.csv").symlink_to(raw.folder / "secret.csv")
    with pytest.raises(WildlabError, match="leaves the folder"):
        import_flight(path, raw.folder / "raw", raw.into)
    assert not raw.into.exists()


def test_an_hour_that_is_there_twice(raw):
    raw.set("time.zone", "Europe/Oslo")
    raw.set("time.epoch", None)
    raw.recipe["truth"].pop()
    for name in ("nav.csv", "photos.csv"):
        raw.tables[name] = raw.tables[name].replace("2024-06-12T09", "2024-10-27T02").replace("Z", "")
    with pytest.raises(WildlabError, match="exists twice"):
        raw.run()
    raw.set("time.zone", "+02:00")
    assert str(raw.run().manifest.time.epoch) == "2024-10-27 00:30:00+00:00"


def test_a_flight_that_is_there_stays(raw):
    raw.run()
    raw.set("description", "second")
    with pytest.raises(WildlabError, match="already"):
        raw.run()
    assert load_flight(raw.into).manifest.description == ""
    flight = import_flight(raw.write(), raw.folder / "raw", raw.into, overwrite=True)
    assert flight.manifest.description == "second"
    with pytest.raises(WildlabError, match="holds other things"):
        import_flight(raw.write(), raw.folder / "raw", raw.folder / "raw", overwrite=True)


def test_names_of_columns_cannot_command_a_terminal(raw):
    raw.replace("clicks.csv", "x,y,what", "\x1b[2J,y,what")
    with pytest.raises(WildlabError) as caught:
        raw.run()
    assert "\x1b" not in str(caught.value)
    assert "'\\x1b[2J'" in str(caught.value)
