"""Words of the report on wrong poses, on opposed numbers."""

from __future__ import annotations

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
