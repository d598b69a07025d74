"""What the tests of readers of tracks share: damage with fixed seeds, and what must hold of any log read."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers import FORMATS, read_log
from wildlab.flight.readers.log import PARTS, TIMES, RawLog

Read = Callable[[Path, bytes, str | None], RawLog]
Columns = dict[str, Any]


class Reader:
    """A format as a flight's import knows it."""

    def __init__(self, name: str) -> None:
        self.name, self.sniff = name, FORMATS[name].function("sniff")

    def read(self, path: Path, data: bytes, zone: str | None = None) -> RawLog:
        return read_log(path, data, self.name, zone)


def damaged(data: bytes, cuts: int = 20, flips: int = 40) -> Iterator[bytes]:
    """Cut at random places; each with one more byte changed, and all of them changed at once."""
    rng = np.random.default_rng(14)
    for at in rng.integers(0, len(data), cuts):
        yield data[:at]
    spoilt = bytearray(data)
    for at in rng.integers(0, len(data), flips):
        one = bytearray(data)
        one[at] = spoilt[at] = int(rng.integers(0, 256))
        yield bytes(one)
    yield bytes(spoilt)


def check(log: RawLog) -> None:
    """Rows of use are finite where a flight needs them to be, and in order of time."""
    for name, stream in log.parts.items():
        columns, used = stream.columns, stream.used
        assert set(columns) <= {*PARTS[name], *TIMES, "use", "why"}
        assert len(stream) == len(stream.rows) > 0
        assert ((columns["why"] == "") == used).all()
        # Images may have been taken where no place was known.
        if "latitude_deg" in columns and name != "triggers":
            assert (np.abs(columns["latitude_deg"][used]) <= 90).all()
            assert np.isfinite(columns["longitude_deg"][used]).all()
            heights = [columns[one][used] for one in columns if one.startswith("height")]
            if heights and np.isfinite(heights).any():
                assert np.isfinite(heights).any(axis=0).all()
        if name in ("poses", "imu"):
            for one in {"roll_deg", "pitch_deg", "yaw_deg", "f_x_m_s2", "w_x_rad_s"} & set(columns):
                assert np.isfinite(columns[one][used]).all()
        assert np.isfinite(columns.get("u_px", np.zeros(len(used)))[used]).all()
        time = columns.get("time_s", np.nan)
        if np.isfinite(time).any():
            assert np.isfinite(time[used]).all()
            assert (np.diff(time[used]) > 0).all()


def columns_of(reader: Any, data: str | bytes, part: str = "gnss", zone: str | None = None) -> Columns:
    """Columns of a part of a log, of which all holds that must."""
    log = reader.read(Path("x"), data.encode() if isinstance(data, str) else data, zone)
    check(log)
    return dict(log.parts[part].columns)


def near(columns: Columns, atol: float = 1e-9, **expected: Any) -> None:
    """Each column is as expected, row by row or in all rows, to within so much."""
    for name, values in expected.items():
        np.testing.assert_allclose(columns[name], values, rtol=0, atol=atol, err_msg=name)


def survives(read: Read, data: bytes, cuts: int = 20, flips: int = 40) -> float:
    """Read all damaged copies; the share that could be read."""
    survived = []
    for one in damaged(data, cuts, flips):
        try:
            check(read(Path("damaged"), one, None))
        except WildlabError as error:
            assert "\n" not in str(error)
            survived.append(False)
            continue
        survived.append(True)
    return float(np.mean(survived))
