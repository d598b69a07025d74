"""DJI's log of images: rows written here and read back, missing parts, damage."""

from pathlib import Path

import pytest

from tests.flight.readers.tracks import Reader, columns_of

dji_mrk = Reader("dji-mrk")


def row(k: int, **other: object) -> str:
    sds = other.get("sds", "0.012000, 0.016000, 0.030000")
    return (
        f"{k}\t{302400 + 2.5 * k:.6f}\t[{other.get('week', 2200)}]\t    18,N\t    -9,E\t   194,V\t"
        f"{other.get('latitude', 63.4 + 1e-5 * k):.8f},Lat\t{other.get('longitude', 10.4):.8f},Lon\t"
        f"{100.0 + 0.1 * k:.3f},Ellh\t{sds}\t{other.get('state', 50)},Q\n"
    )


def test_states_placeholders_and_repetition():
    cases = [{}, {"state": 0}, {"state": 16}, {"state": 34}, {"latitude": 0.0, "longitude": 0.0}]
    text = "".join(row(k, **case) for k, case in enumerate(cases)) + row(3) + row(9, week=99999)
    columns = columns_of(dji_mrk, text, "triggers")
    assert columns["fix"].tolist() == [6, 0, 3, 5, 6, 6, 6]
    assert columns["why"].tolist() == [
        *("", "no fix", "", "", "position is a placeholder", "repeated stamp", "impossible time")
    ]


@pytest.mark.parametrize("codec", ["utf-8-sig", "utf-16", "latin-1"])
def test_encodings_missing_fields_and_lost_lines(codec):
    text = row(1) + row(2).replace("    18,N\t    -9,E\t   194,V\t", "") + row(3, sds="") + "<b>=1+1</b>\n"
    log = dji_mrk.read(Path("x.MRK"), (text + row(4)[:60]).replace("\n", "\r\n").encode(codec))
    assert len(log.parts["triggers"]) == 3
    assert log.parts["triggers"].used.all()
    assert log.lost[0].startswith("2 ")
