"""Sections of the overview of a flight: tiles, maps, streams, motion, satellites, shaking, clocks."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.analysis.overviews.alarms import beside_satellites
from wildlab.analysis.overviews.overview import Overview
from wildlab.analysis.overviews.verdict import Numbers
from wildlab.evaluation.vibration import FINE, HARMFUL
from wildlab.flight.clocks import gnss_times
from wildlab.reporting import overview_words as words
from wildlab.reporting.charts import overview as charts
from wildlab.reporting.report import Report
from wildlab.reporting.text import number, percent

#: Positions closer than this are the same, but for rounding, m.
SAME_M = 1e-3


def tiles(overview: Overview) -> list[tuple[str, str]]:
    """The few numbers to remember."""
    found = []
    if np.isfinite(overview.length_s):
        found.append((words.duration_words(overview.length_s), "from the first to the last record"))
    way = words.way_of(overview)
    if np.isfinite(way) and overview.path is not None:
        found.append((words.length_words(way), f"path of {charts.path_name(overview.path)}"))
    if overview.above is not None and np.isfinite(overview.above[0]).any():
        median = float(np.nanmedian(overview.above[0]))
        if height := words.height_words(median, median):
            found.append((height, f"median height above {overview.above[1]}"))
    frames = overview.flight.frames
    if frames is not None and len(frames):
        without = next((one.lost for one in overview.lost if one.key == "images_without_pose"), 0)
        posed = len(frames) - without if overview.source else 0
        found.append((f"{posed} / {len(frames)}", "images with a pose"))
    if overview.coverage is not None and overview.coverage.placed.any():
        found.append((words.area_words(overview.coverage.area_m2), "ground in at least one image"))
    if overview.detections[0]:
        pixels = overview.detections_in_images
        on_ground = (f"{overview.detections[2]} / {pixels}", "detections on the ground")
        # A radar's are put nowhere by a camera's ray: that none is on the ground would say nothing.
        found.append(on_ground if pixels else (str(overview.detections[0]), "detections"))
    if overview.vibration is not None:
        found.append((f"{number(overview.vibration[0].worst.max())} m/s²", "strongest shaking above 5 Hz"))
    return found or [("none", "numbers: there are no stamps and no poses")]


def places_section(report: Report, overview: Overview) -> None:
    """The map of the path, and that of what the images showed."""
    report.section("Where it flew, and what it saw")
    path, coverage = overview.path, overview.coverage
    figures = []
    if path is not None:
        title = words.path_title(overview)
        figures.append(
            (
                charts.path_chart(path, overview.troubles, title),
                "path",
                f"Map of the path in metres east and north of a local origin. {title}.",
                f"Path of {charts.path_name(path)}, coloured by what is wrong; where several things "
                "are, by the "
                "first in the list. Metres from a chosen point, north up.",
            )
        )
    if coverage is not None and coverage.placed.any():
        title = f"The images show {words.area_words(coverage.area_m2)} of ground"
        figures.append(
            (
                charts.coverage_chart(coverage, path, title),
                "coverage",
                f"Map of how many images show each place. {title}.",
                f"How many images show each place, on {coverage.ground}; the line is the path.",
            )
        )
    if figures:
        report.figures(figures)
    if path is None:
        report.text("There is no map: no table of this flight has positions over time.")
    if coverage is not None:
        report.points(words.coverage_sentences(coverage, overview.detections))
    else:
        report.text(f"What the images show of the ground is not known: {overview.uncovered}.")


def streams_section(report: Report, overview: Overview, clock: charts.Clock) -> None:
    """Rates and pauses."""
    named = {name: pace for name, pace in overview.streams.items() if pace.n}
    report.section("What was recorded, how often, and where it pauses")
    if not named:
        report.text("No table of this flight has stamps.")
        return
    timed = overview.flight.manifest.time.kind == "utc"
    if not timed:
        report.text(
            "The photos carry no time, their stamps merely number them: rates and pauses mean nothing."
        )
        return
    title = words.streams_title(overview)
    report.figure(
        charts.streams_chart(named, clock, title),
        name="streams",
        alt=f"Bars over time for each of {len(named)} streams. {title}.",
        caption="When each stream gave samples; pauses in red. A pause is longer than a second, and than one "
        "and a half usual steps.",
    )
    report.table(
        words.streams_table(overview),
        columns={
            "stream": "stream",
            "n": "samples",
            "rate": "rate (Hz)",
            "wavering": "steps waver by (ms)",
            "missing": "missing (%)",
            "pauses": "pauses",
            "paused": "in all (s)",
            "longest": "longest (s)",
            "unordered": "not increasing",
        },
        digits={"rate": 1, "wavering": 1, "missing": 2, "paused": 1, "longest": 1},
        caption="Rate by the median step, and half the width of the middle 90 % of the steps; a stream that "
        "wavers by more than half a step has no rate.",
    )


def motion_section(report: Report, overview: Overview, clock: charts.Clock) -> None:
    """Heights, speeds, attitudes and turning over time."""
    if not any(overview.series.values()):
        return
    report.section("Height, speed and attitude")
    height, speed = overview.series["height"], overview.series["speed"]
    row = []
    if height:
        ground = None
        if overview.above is not None and overview.path is not None:
            ground = overview.path.times, -overview.path.place[:, 2] - overview.above[0]
        title = "Height above the local origin"
        caption = "Height above the local origin" + (
            f"; the ground is {overview.above[1]}."
            if overview.above
            else "; the height of the ground is not known."
        )
        chart = charts.lines_chart(height, clock, "height (m)", title, ground=ground)
        low = min(float(values.min()) for _, values in height.values())
        high = max(float(values.max()) for _, values in height.values())
        row.append((chart, "height", f"Height over time, from {low:.0f} to {high:.0f} metres.", caption))
    if speed:
        fastest = max(float(np.nanmax(values)) for _, values in speed.values())
        chart = charts.lines_chart(
            speed, clock, "speed (m/s)", f"At most {fastest:.1f} m/s over the ground", floor=True
        )
        row.append(
            (
                chart,
                "speed",
                f"Speed over time, {fastest:.1f} metres a second at most.",
                "Speed over the ground.",
            )
        )
    if row:
        report.figures(row)
    row = []
    if attitude := overview.series["attitude"]:
        steep = max(float(np.nanmax(np.abs(angles[:, :2]))) for _, angles in attitude.values())
        chart = charts.attitude_chart(attitude, clock, f"Leans by at most {steep:.0f}°")
        alt = f"Roll, pitch and yaw over time; leans by at most {steep:.0f} degrees."
        caption = "Attitude of the airframe: roll to the right, pitch up, yaw from north to east."
        row.append((chart, "attitude", alt, caption))
    for times, rates in overview.series["turning"].values():
        fastest = float(np.abs(rates).max())
        chart = charts.turning_chart(times, rates, clock, f"Turns by at most {fastest:.0f} °/s")
        alt = f"Angular rates over time, at most {fastest:.0f} degrees a second."
        caption = "What the inertial sensor feels of turning: least and greatest of each stretch."
        row.append((chart, "turning", alt, caption))
    if row:
        report.figures(row)


def satellites_section(report: Report, overview: Overview, clock: charts.Clock) -> None:
    """Fixes: satellites, stated uncertainty, kinds."""
    gnss = overview.flight.gnss
    if gnss is None or not len(gnss):
        return
    report.section("Satellite positions")
    times = gnss_times(overview.flight)
    known = np.isfinite(times)
    satellites, said, sd = None, [], {}
    if "satellites" in gnss and gnss["satellites"].notna().any():
        satellites = times[known], gnss["satellites"].to_numpy(float)[known]
        least, usual = np.nanmin(satellites[1]), np.nanmedian(satellites[1])
        said.append(f"{usual:.0f} satellites in the median, {least:.0f} at least.")
    for name, column in (("each horizontal axis", "sd_horizontal_m"), ("height", "sd_vertical_m")):
        if column in gnss and gnss[column].notna().any():
            sd[name] = times[known], gnss[column].to_numpy(float)[known]
            usual, most = np.nanmedian(sd[name][1]), np.nanmax(sd[name][1])
            said.append(
                f"Stated standard deviation of {name}: {usual:.2f} m in the median, {most:.2f} m at most."
            )
    if "fix" in gnss and gnss["fix"].notna().any():
        kinds = gnss["fix"].value_counts(normalize=True)
        shares = ", ".join(f"{kind:g} in {percent(share, 0)}" for kind, share in kinds.items())
        said.append(f"Kinds of fix, as the receiver numbers them: {shares}.")
    if not said:
        said.append(
            "The receiver states neither satellites, nor kinds of fix, nor how uncertain its positions are."
        )
    if apart := differences(overview):
        said.append(apart)
    report.points(said)
    if (satellites or sd) and overview.series:
        title = "Stated SD of the positions"
        if satellites is not None:
            title = f"{np.nanmin(satellites[1]):.0f} satellites or more"
        report.figure(
            charts.satellites_chart(satellites, sd, clock, title),
            name="satellites",
            alt=f"Satellites and stated standard deviations over time. {said[0]}",
            caption="What the receiver states of its positions.",
        )


def differences(overview: Overview) -> str:
    """How far the shown poses lie from the satellite positions; nothing where either lacks."""
    path, gnss = overview.path, overview.flight.gnss
    if path is None or not path.who.startswith("nav/") or not path.timed or gnss is None:
        return ""
    gaps = overview.streams[path.who].gaps
    _, off, _ = beside_satellites(overview.flight, path.times, path.place, gaps)
    if not len(off):
        return ""
    level, up = np.hypot(off[:, 0], off[:, 1]), -off[:, 2]
    if np.median(np.abs(off)) < SAME_M:
        return f"The poses of {charts.path_name(path)} have the positions of the satellites."
    return (
        f"The poses of {charts.path_name(path)} lie {np.median(level):.2f} m beside the satellite "
        "positions in "
        f"the median ({np.quantile(level, 0.95):.2f} m at 95 %), and {np.median(up):+.2f} m above them; "
        "the antenna's own place is in that."
    )


def shaking_section(report: Report, overview: Overview, clock: charts.Clock) -> None:
    """Vibration by band, and by the measure of the limits."""
    imu = overview.flight.imu
    if imu is None or not len(imu):
        return
    report.section("Shaking")
    if overview.vibration is None:
        report.text("The inertial samples are too few or too slow to tell how much it shakes.")
        return
    found, times = overview.vibration
    report.points(
        [
            words.shaking_sentence(found),
            f"The samples come at {found.rate_hz:.0f} Hz: what is faster than {found.rate_hz / 2:.0f} "
            "Hz is not "
            "in them, or looks slower than it is.",
        ]
    )
    report.figures(
        [
            (
                charts.shaking_chart(found, times, clock, words.shaking_title(found)),
                "shaking",
                f"Shaking of each axis over time. {words.shaking_sentence(found)}",
                "The greatest of each stretch, by the measure of ArduPilot's VIBE message. The "
                "limits are those of "
                f"its documentation (Measuring Vibration): {FINE:g} m/s² and {HARMFUL:g} m/s².",
            ),
            (
                charts.bands_chart(found, words.bands_title(found)),
                "bands",
                f"Root mean square of the specific force by band of frequency. {words.bands_title(found)}.",
                "Specific force by band, mean over the flight. What steers the aircraft is in the lowest.",
            ),
        ]
    )


def clocks_section(report: Report, overview: Overview, numbers: Numbers) -> None:
    """Offsets of the clocks: those stated, and that of the camera where it was estimated."""
    manifest = overview.flight.manifest
    if manifest.time.kind != "utc":
        return
    report.section("Clocks")
    tables = overview.flight.tables
    stated = [
        ("camera", manifest.clocks.camera_offset_s, "frames" in tables),
        ("truth", manifest.clocks.truth_offset_s, "truth" in tables),
        ("satellite receiver", manifest.clocks.gnss_offset_s - manifest.gnss.latency_s, "gnss" in tables),
    ]
    rows = []
    for name, offset, there in stated:
        if there:
            entry = numbers.get(("clock_offset", "calibration")) if name == "camera" else None
            certain = entry is not None and None not in (entry["value"], entry["low"], entry["high"])
            left = ""
            if entry is not None and certain:
                left = f"{entry['value']:+.3f} s ({entry['low']:+.3f} to {entry['high']:+.3f})"
            rows.append({"clock": name, "offset": offset, "left": left or "not measured"})
    if not rows:
        report.text("No clock but that of the poses is in this flight.")
        return
    report.table(
        pd.DataFrame(rows),
        columns={
            "clock": "clock",
            "offset": "added to its stamps (s)",
            "left": "still to be added, with 95 % interval",
        },
        digits={"offset": 3},
        caption="What is left of the camera's clock comes from known points, where it is part of the "
        "cause that "
        "the report on the georeferencing found.",
    )
