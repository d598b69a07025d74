"""Sections of the report on many targets: what is shown, in which order."""

from __future__ import annotations

from wildlab.analysis.many.errors import OF_COVARIANCE, counted_twice, of_platform
from wildlab.analysis.many.follow import ManyTracks
from wildlab.evaluation.identities import Identities
from wildlab.reporting import many_tracks as words
from wildlab.reporting.charts import many as charts
from wildlab.reporting.report import Report
from wildlab.reporting.text import listed


def head_section(report: Report, followed: ManyTracks, lives: Identities | None) -> None:
    """Title and summary."""
    by = ", ".join(followed.places)
    report.head("Who is where, and who is who?", f"All targets at once, by {by}")
    said, level = words.summary(followed, lives)
    report.summary(said, level=level, verdict=words.verdict_of(followed, lives, level))
    if followed.notes:
        report.points(followed.notes)


def pictures_section(report: Report, followed: ManyTracks, lives: Identities | None) -> None:
    """The map, and with truth who is on whom and what is wrong when."""
    figure, name, alt, caption = charts.map_shown(followed)
    report.figure(figure, name=name, alt=alt, caption=caption, main=True)
    if lives is None or not any(life.visible for life in lives.targets.values()):
        return
    report.section("Who is who, look by look")
    shown = [charts.identities_shown(followed, lives)] if any(lives.followed) else []
    report.figures([*shown, charts.wrong_shown(followed, lives)])


#: A table of more tracks is folded away.
MOST_SHOWN = 25


def tables_section(report: Report, followed: ManyTracks, lives: Identities | None) -> None:
    """Targets, tracks, and what GOSPA is made of."""
    if lives is not None and lives.targets:
        report.section("Every target")
        report.table(
            words.targets_table(lives),
            columns=words.TARGETS,
            digits={"tracked": 0, "confirm": 1, "looks": 0},
            caption="In reach: named by a detection, in the camera's view, or no farther than any sensor "
            "sees. First after: from the first look in reach to the first with a track. New tracks: another "
            "one than before, which was on no target.",
        )
        report.table(
            words.parts_table(lives.gospa),
            columns={"part": "", "metres": "m", "share": "of the square (%)"},
            digits={"metres": 2, "share": 0},
            caption=words.caption_of_gospa(followed.cutoff_m),
        )
    table = words.tracks_table(followed, lives)
    if not len(table):
        return
    report.section("Every track")
    report.table(
        table,
        columns={name: heading for name, heading in words.TRACKS.items() if name in table},
        digits={"from": 1, "to": 1, "looks": 0, "on": 0, "nees": 2, "alone": 2},
        caption="Seconds since the first look."
        + (
            " On a target: of the looks at which the track is judged. Mean NEES / 2: 1 where errors are as "
            "large as the track says, more where they are larger; with the truth's own error, and with the "
            "truth taken for exact."
            if lives is not None
            else ""
        ),
        fold=f"All {len(table)} tracks, one by one" if len(table) > MOST_SHOWN else "",
    )


def told_section(report: Report, followed: ManyTracks) -> None:
    """What the tracker was told, and by whom."""
    report.section("What the tracker was told", words.assumed_sentence(followed.said))
    headings = {"of": "of", "what": "what", "value": "value", "source": "from"}
    report.table(words.told_table(followed.said), columns=headings)


def _truth_words(followed: ManyTracks) -> str:
    """Whose errors the truth's are."""
    words = []
    known = {name: sd for name, sd in followed.truth_sd.items() if sd > 0}
    if estimated := [sd for name, sd in known.items() if name in followed.truth_estimated]:
        words.append(
            f"Nothing states how wrong the truth is. From one to the next its positions are wrong by up to "
            f"{max(estimated):.2g} m (SD of each axis); slower errors are not in it and count as the tracks'."
        )
    elif known:
        words.append("The stated standard deviation of the truth is counted beside that of the tracks.")
    if left := len(followed.truth) - len(known):
        some = f"of {left} of {len(followed.truth)} targets " if known else ""
        words.append(
            f"The truth {some}has no standard deviation of its own: its error counts as the tracks'."
        )
    return " ".join(words)


def _smoothed_words(followed: ManyTracks) -> list[str]:
    """Why smoothed places have no covariance, where they have none."""
    if not followed.unknown_lasting:
        return []
    return [
        f"How long errors of {listed(list(followed.unknown_lasting))} last is not stated: smoothed places "
        "have no covariance, which would leave out what lasts."
    ]


def pose_limits(followed: ManyTracks) -> list[str]:
    """What is not said of errors of the platform and of bearings, in sentences."""
    kinds = {one.kind for one in followed.places.values()}
    said = []
    if "pixel" in kinds:
        said.append(
            "Errors of the pose are those that all detections of an image share, considered and not "
            "estimated; and what an image shows is told by the same poses."
        )
    if "bearing" in kinds:
        said.append(
            "A bearing moves a track that another sensor began; it begins and confirms none, and is no "
            "sighting that a track is shown for. One whose place bearings keep known is not given up."
        )
    bare = [
        name
        for name, one in followed.places.items()
        if not {"heading", "platform_north", "platform_east"} & of_platform(one.errors)
    ]
    if bare:
        said.append(
            f"Errors of the platform's position and heading that last are in no covariance of {listed(bare)}."
        )
    every = {name: one.errors for name, one in followed.places.items()}
    for name, own in every.items():
        others = [other for other, errors in every.items() if counted_twice(own, errors)]
        if others:
            twice = (
                f"Errors of the platform that {name} and {listed(others)} share are taken for two: tracks of "
                "both may be surer than they should be."
            )
            if OF_COVARIANCE[0] not in own.names:
                twice += f" They are one where `correlation_time_s` is stated in [sensors.{name}]."
            said.append(twice)
    return said


def end_section(report: Report, followed: ManyTracks) -> None:
    """What is not said, and how it was computed."""
    hulls = " Each track is of every kind of hull at once, which differ in where on the hull it is seen."
    judged = [
        f"A track farther than {followed.cutoff_m:g} m from every target is on nothing here, also where it "
        "follows one whose places are that far off.",
        _truth_words(followed),
        "Tracks on others than the targets whose places are known are not told from tracks on nothing, and "
        "one beside a known target may count as its. Where there are such, state `others = true` in "
        "[targets.many]."
        if not followed.others
        else "A track on another target beside one whose place is known may count as on that one.",
    ]
    report.limits(
        [
            *(judged if followed.truth else []),
            "A target that comes back after its track ended has another one: tracks are no count of targets.",
            *_smoothed_words(followed),
            *pose_limits(followed),
        ]
    )
    report.method(
        "Joint integrated probabilistic data association with visibility (H 8.2): in every look each "
        "detection is of each track, of something new, or of nothing, with probabilities over all ways to "
        "deal them out; a track's estimate is the mean over these ways. Whether a target exists and whether "
        "it can be seen are estimated apart: one that is hidden is not given up at once."
        + (hulls if len(followed.targets.hulls) > 1 else "")
    )
