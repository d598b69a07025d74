"""What is found in single rendered pictures of animals, and what it counts as."""

from dataclasses import replace

import numpy as np
import pytest

from tests.studies.animal_pictures import CAMERA, DARK, picture_of, rhino
from wildlab.simulation.scene.drawn import slab, tree
from wildlab.simulation.scene.flights import IDEAL
from wildlab.studies import wildlife_detection
from wildlab.studies.wildlife_detection import (
    CONSTANT,
    METHODS,
    SUBTRACTED,
    find,
    judge,
)


def test_animals_in_the_open_are_found_and_nothing_else():
    picture = picture_of(rhino(0, -4), rhino(0, 4, 1.0))
    judged = judge(picture, find(picture, METHODS[CONSTANT]))
    assert judged.counts.tolist() == [2, 0, 0]


def test_a_warm_slab_is_a_false_alarm_and_a_missed_animal_is_missed():
    picture = picture_of(rhino(0, -4), slab(2.0, 2.0, 14.0).at(0.0, 4.0))
    judged = judge(picture, find(picture, METHODS[CONSTANT]))
    assert judged.counts.tolist() == [1, 1, 0]
    deaf = judge(picture, find(picture, replace(METHODS[CONSTANT], level=254.0)))
    assert deaf.counts.tolist() == [0, 0, 1]


def test_an_animal_under_a_tree_counts_neither_way():
    under = replace(tree(3.6, DARK), texture_seed=4).at(0.9, 0.0)
    picture = picture_of(rhino(), under)
    assert picture.view.visible(1) < wildlife_detection.SHOWN
    assert picture.animals == {}
    judged = judge(picture, find(picture, replace(METHODS[CONSTANT], smallest_px=3.0)))
    assert judged.counts.tolist() == [0, 0, 0]


def test_pieces_of_one_animal_are_found_once_and_invented_for_the_rest():
    picture = picture_of(rhino())
    found = find(picture, METHODS[CONSTANT])
    twice = found.select(np.array([0, 0]))
    assert judge(picture, twice).counts.tolist() == [1, 1, 0]
    assert len(judge(picture, twice).rows[1]) == 2


def test_a_detection_much_larger_than_the_animal_is_not_of_it():
    picture = picture_of(rhino())
    found = find(picture, METHODS[CONSTANT])
    assert judge(picture, replace(found, area=found.area * 5)).counts.tolist() == [0, 1, 1]


def test_what_is_proposed_follows_from_the_ground():
    picture = picture_of(rhino())
    sized = wildlife_detection.proposed(wildlife_detection.BY_SIZE, picture, CAMERA, IDEAL)
    assert sized.smallest_px == pytest.approx(0.2 * (320 / 30) ** 2)
    near = replace(picture, distance=15.0)
    assert (
        wildlife_detection.proposed(wildlife_detection.BY_BLOCK, near, CAMERA, IDEAL).block_px
        > wildlife_detection.proposed(wildlife_detection.BY_BLOCK, picture, CAMERA, IDEAL).block_px
    )
    cold = wildlife_detection.proposed(wildlife_detection.NOT_HOT, picture, CAMERA, IDEAL)
    oven = picture_of(rhino(0, -4), slab(2.0, 2.0, 60.0).at(0.0, 4.0))
    assert judge(oven, find(oven, METHODS[SUBTRACTED])).counts.tolist() == [1, 1, 0]
    assert judge(oven, find(oven, cold)).counts.tolist() == [1, 0, 0]
