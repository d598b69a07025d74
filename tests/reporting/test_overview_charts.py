"""Lines of an overview's charts that a reader has to tell apart."""

import numpy as np

from wildlab.reporting.charts.overview import Clock, lines_chart

SOURCES = ("autopilot", "truth", "mine", "truth-payload", "mekf")


def test_every_source_and_the_ground_have_a_look_of_their_own():
    times = np.arange(3.0)
    series = {name: (times, times + index) for index, name in enumerate(SOURCES)}
    figure = lines_chart(series, Clock(0.0, 10.0), "height (m)", "Heights", ground=(times, times))
    looks = {line.get_label(): (line.get_color(), line.get_linestyle()) for line in figure.axes[0].lines}
    assert set(looks) == {"ground", *SOURCES} and len(set(looks.values())) == len(looks)
    black = {name for name, (color, _) in looks.items() if color == "#000000"}
    assert black == {"truth", "truth-payload"}
