"""What the tests of readers of tracks share: damage with fixed seeds, and what must hold of any log read."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers.logs.log import PARTS, TIMES, RawLog

Reader = Callable[[Path, bytes, str | None], RawLog]


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
        assert set(stream.columns) <= {*PARTS[name], *TIMES, "use", "why"}
        assert len(stream) == len(stream.rows) > 0
        used = stream.used
        assert ((stream.columns["why"] == "") == used).all()
        if "latitude_deg" in stream.columns:
            assert np.isfinite(stream.columns["latitude_deg"][used]).all()
            assert np.isfinite(stream.columns["longitude_deg"][used]).all()
            heights = [stream.columns[one][used] for one in stream.columns if one.startswith("height")]
            if heights and np.isfinite(heights).any():
                assert np.isfinite(heights).any(axis=0).all()
        time = stream.columns["time_s"]
        if np.isfinite(time).any():
            assert np.isfinite(time[used]).all()
            assert (np.diff(time[used]) > 0).all()


def survives(read: Reader, data: bytes, cuts: int = 20, flips: int = 40) -> float:
    """Read all damaged copies; the share that could be read."""
    survived = []
    for one in damaged(data, cuts, flips):
        try:
            check(read(Path("damaged"), one, None))
        except WildlabError:
            survived.append(False)
            continue
        survived.append(True)
    return float(np.mean(survived))
