"""Words of the report on wrong poses, on opposed numbers."""

from __future__ import annotations

import numpy as np

from wildlab.studies.sensitivity import text


def errors(tilt_far: float, place_far: float) -> dict[str, float]:
    near = {"roll": 5.0, "pitch": 5.0, "yaw": 0.0, "north": 10.0, "east": 10.0, "down": 1.0}
    far = {
        "roll": tilt_far,
        "pitch": tilt_far,
        "yaw": 0.0,
        "north": place_far,
        "east": place_far,
        "down": 1.0,
    }
    return {f"level/{n}/100m": v for n, v in near.items()} | {f"level/{n}/400m": v for n, v in far.items()}


def test_words_turn_with_their_numbers() -> None:
    assert text.growth(errors(20.0, 10.0)) == (4.0, 1.0)
    assert "4.0 times as far or more, an error of position no farther" in text.growth_words(
        errors(20.0, 10.0)
    )
    assert "height hardly matters" in text.growth_words(errors(5.0, 10.0))
    assert "an error of position up to 3.0 times: fly lower." in text.growth_words(errors(20.0, 30.0))
    assert text.heading(errors(20.0, 10.0)) == "Angles matter more than places"
    assert text.heading(errors(8.0, 10.0)) == "Most is moved by north"
    assert text.distance_words(0.321, 41.0) == "One kilometre costs 0.32 m, ten cost 41 m"


def test_the_middle_is_called_what_it_is() -> None:
    middle = {"level": 30.0, "turn": 40.0}
    ramp = np.linspace(20.0, 60.0, 100).reshape(10, 10)
    title, said, alt = text.image_words({"level": ramp, "turn": ramp + 10}, middle)
    assert title == "Over most of the image it is worse than in the middle"
    assert "over 75 to 75 % of the image: 30 m in the middle, 60 m at most in level; 40 m" in said
    assert "20 m where it is smallest, 70 m where it is largest, in turn" in alt
    title, said, _ = text.image_words({"level": ramp, "turn": ramp}, {"level": 55.0, "turn": 50.0})
    assert title == "Over most of the image it is better than in the middle" and "13 to 25 %" in said
    title, _, _ = text.image_words({"level": ramp, "turn": ramp}, {"level": 30.0, "turn": 55.0})
    assert title == "The middle of the image does not stand for all of it"


def test_how_many_come_out_follows_the_count_of_printed_digits() -> None:
    assert text.printed_words(np.array([0.01, -0.02]), 2) == (
        "The thesis prints 2 such numbers; all of them come out here to the last printed digit."
    )
    assert text.printed_words(np.array([0.01, -0.12]), 1).endswith(
        "; 1 of them come out here to the last printed digit, the others within 0.12 metres."
    )
