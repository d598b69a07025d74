"""GOSPA over scans and changes of identity against Stone Soup, where it is installed."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from wildlab.evaluation.identities import Moment, compare_identities

CUTOFF = 20.0


def wandering(rng, scans=25, targets=3):
    """Targets on straight lines, tracks about them that come, go and change their names; times in s."""
    start, speed = rng.uniform(-40, 40, (targets, 2)), rng.normal(0, 3, (targets, 2))
    order = np.arange(targets)
    for t in range(scans):
        if rng.random() < 0.2:
            order = rng.permutation(targets)
        there = rng.random(targets) < 0.8
        truth = start + t * speed
        x = (truth + rng.normal(0, 6, truth.shape))[there]
        yield Moment(
            float(t),
            x,
            np.broadcast_to(np.eye(2), (len(x), 2, 2)),
            order[there].tolist(),
            truth,
            list("abc"),
            np.ones(targets, bool),
            np.zeros(targets, bool),
        )


@pytest.mark.parametrize("seed", range(5))
def test_gospa_and_changes_of_identity_are_stone_soups(seed):
    pytest.importorskip("stonesoup")
    from stonesoup.measures import Euclidean
    from stonesoup.metricgenerator.clearmotmetrics import ClearMotMetrics
    from stonesoup.metricgenerator.manager import MultiManager
    from stonesoup.metricgenerator.ospametric import GOSPAMetric
    from stonesoup.types.association import AssociationSet, TimeRangeAssociation
    from stonesoup.types.groundtruth import GroundTruthPath, GroundTruthState
    from stonesoup.types.state import State
    from stonesoup.types.time import TimeRange
    from stonesoup.types.track import Track

    epoch = datetime(2020, 1, 1, tzinfo=UTC)
    scans = list(wandering(np.random.default_rng(seed)))
    found = compare_identities(scans, CUTOFF)
    truths = {name: GroundTruthPath(id=name) for name in "abc"}
    tracks = {identity: Track(id=str(identity)) for identity in found.tracks}
    associations = set()
    for scan, followed in zip(scans, found.followed, strict=True):
        stamp = epoch + timedelta(seconds=scan.time)
        for name, place in zip(scan.names, scan.truth, strict=True):
            truths[name].append(GroundTruthState(place[:, None], timestamp=stamp))
        for identity, place in zip(scan.identities, scan.positions, strict=True):
            tracks[identity].append(State(place[:, None], timestamp=stamp))
        # An association at one scan: a range that ends before the next.
        span = TimeRange(stamp, stamp + timedelta(seconds=0.5))
        associations |= {
            TimeRangeAssociation({truths[name], tracks[identity]}, span)
            for name, identity in followed.items()
        }
    manager = MultiManager(
        [
            GOSPAMetric(p=2, c=CUTOFF, measure=Euclidean()),
            ClearMotMetrics(distance_measure=Euclidean()),
        ]
    )
    manager.add_data({"groundtruth_paths": set(truths.values()), "tracks": set(tracks.values())})
    manager.association_set = AssociationSet(associations)
    metrics = manager.generate_metrics()
    theirs = {one.timestamp: one.value for one in metrics["gospa_generator"]["GOSPA Metrics"].value}
    for scan, ours in zip(scans, found.gospa, strict=True):
        value = theirs[epoch + timedelta(seconds=scan.time)]
        assert ours.distance == pytest.approx(value["distance"], abs=1e-9)
        assert ours.localisation**2 == pytest.approx(value["localisation"], abs=1e-9)
        assert ours.missed**2 == pytest.approx(value["missed"], abs=1e-9)
        assert ours.false**2 == pytest.approx(value["false"], abs=1e-9)

    # Theirs counts changes from one scan to the very next, ours also those over a gap.
    states = 3 * len(scans)
    wrong = sum(
        3 + len(scan.identities) - 2 * len(at) for scan, at in zip(scans, found.followed, strict=True)
    )
    changes = round((1 - metrics["clearmot_generator"]["MOTA"].value) * states) - wrong
    at_once = sum(
        name in before and before[name] != identity
        for before, at in zip(found.followed, found.followed[1:], strict=False)
        for name, identity in at.items()
    )
    assert changes == at_once
    assert found.swaps + found.breaks >= changes > 0
