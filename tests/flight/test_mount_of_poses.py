"""A mount belongs to one nav source where there are several: with others it is refused or left out."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.pipeline.survey_twin import Survey, simulate
from wildlab.errors import WildlabError
from wildlab.flight.checks.check import check_flight
from wildlab.flight.checks.sense.sightings import sightings
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.pipeline.georeference import observe


def two_sources(poses: str) -> Flight:
    """A survey whose camera has a log of its own beside the vehicle's."""
    flight = simulate(Survey(images=6))
    manifest = replace_in_manifest(flight.manifest, {"mount": {"poses": poses}})
    return replace(
        flight, manifest=manifest, nav={"camera": flight.nav["logged"], "vehicle": flight.nav["logged"]}
    )


def test_the_mount_is_used_on_its_own_poses_and_refused_on_others():
    flight = two_sources("camera")
    assert len(observe(flight, "camera").table)
    with pytest.raises(WildlabError, match="'vehicle' are used") as caught:
        observe(flight, "vehicle")
    assert caught.value.field == "mount.poses"
    both = two_sources("")
    assert len(observe(both, "camera").table) == len(observe(both, "vehicle").table)


def test_sense_is_not_asked_of_a_mount_on_other_poses():
    flight = two_sources("camera")
    assert sightings(flight, "camera") is not None and sightings(flight, "vehicle") is None


def test_a_mount_on_poses_that_are_not_there_is_a_problem():
    found = [one for one in check_flight(two_sources("logger")) if one.field == "mount.poses"]
    assert [one.level for one in found] == ["problem"]
    assert not [one for one in check_flight(two_sources("camera")) if one.field == "mount.poses"]
