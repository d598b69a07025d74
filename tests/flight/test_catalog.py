"""Fetching: the right bytes or none, from a mirror or from a (local, made-up) network."""

import hashlib
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

from wildlab.errors import WildlabError
from wildlab.flight import catalog
from wildlab.flight.catalog import DataFile, dataset_folder, fetch, is_fetched

GOOD = {"a.csv": b"one\n", "b.csv": b"two\n"}


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("bad", ["a", "b"])
def test_wrong_bytes_leave_nothing(web, dataset, tmp_path, monkeypatch, bad, mirrored):
    dataset(web[0])
    _put(web[1], **{bad: b"evil"})
    if mirrored:
        monkeypatch.setenv("WILDLAB_DATA_MIRROR", str(web[1]))
    with pytest.raises(WildlabError) as caught:
        fetch("small")
    for content in (b"evil", GOOD[f"{bad}.csv"]):
        assert hashlib.sha256(content).hexdigest() in str(caught.value)
    assert f"{bad}.csv" in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["web"]
    assert (web[1] / f"{bad}.csv").read_bytes() == b"evil"


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture
def web(tmp_path: Path) -> Iterator[tuple[str, Path]]:
    """Address and folder of a small web server."""
    folder = tmp_path / "web"
    folder.mkdir()
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(folder)))
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}", folder
    server.shutdown()
    server.server_close()


@pytest.fixture
def dataset(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[str], None]:
    """``dataset("http://...")`` makes a catalog with one data set of two files at that address."""
    monkeypatch.delenv("WILDLAB_DATA_MIRROR", raising=False)
    monkeypatch.setattr(catalog, "fetched", lambda: tmp_path / "here")
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")

    def make(address: str) -> None:
        files = tuple(
            DataFile.model_construct(
                path=name,
                url=f"{address}/{name}",
                size=len(data),
                sha256=hashlib.sha256(data).hexdigest(),
                mirror=f"deep/{name}",
            )
            for name, data in GOOD.items()
        )
        made = catalog.DataSet(title="", source="", commit="", licence="MIT", files=files)
        monkeypatch.setattr(catalog, "read_catalog", lambda: {"small": made})

    return make


def _put(folder: Path, **changed: bytes) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in GOOD.items():
        (folder / name).write_bytes(changed.get(name.removesuffix(".csv"), data))


def test_download_and_not_again(web, dataset, tmp_path):
    dataset(web[0])
    _put(web[1])
    told: list[tuple[str, int, int]] = []

    def fetched() -> list[Path]:
        told.clear()
        return fetch("small", lambda *progress: told.append(progress))

    assert not is_fetched("small")
    paths = fetched()
    assert [path.read_bytes() for path in paths] == list(GOOD.values())
    assert told == [("a.csv", 0, 2), ("b.csv", 1, 2)]
    assert is_fetched("small")
    (web[1] / "a.csv").unlink()
    assert fetched() == paths and told == []
    paths[1].write_bytes(b"changed")
    assert not is_fetched("small")
    fetched()
    assert told == [("b.csv", 0, 1)]
    assert paths[1].read_bytes() == b"two\n"


def test_no_network_and_no_mirror_is_one_sentence(dataset, tmp_path):
    dataset("http://127.0.0.1:1")
    with pytest.raises(WildlabError, match="WILDLAB_DATA_MIRROR") as caught:
        fetch("small")
    assert caught.value.__cause__ is None
    assert caught.value.__suppress_context__
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("layout", ["", "deep"])
def test_mirror_instead_of_network(dataset, tmp_path, monkeypatch, layout):
    dataset("http://127.0.0.1:1")
    monkeypatch.setenv("WILDLAB_DATA_MIRROR", str(tmp_path / "mirror"))
    _put(tmp_path / "mirror" / layout)
    paths = fetch("small")
    assert [path.read_bytes() for path in paths] == list(GOOD.values())
    assert sorted(path.name for path in (tmp_path / "here" / "small").iterdir()) == ["a.csv", "b.csv"]


def test_an_unknown_data_set_lists_the_known():
    with pytest.raises(WildlabError, match="mean 'openathena'"):
        fetch("openatena")
    with pytest.raises(WildlabError, match="Use one of autoferry"):
        dataset_folder("../..")


@pytest.mark.parametrize("mirrored", [False, True])
def test_no_more_bytes_are_taken_than_the_catalog_says(web, dataset, tmp_path, monkeypatch, mirrored):
    dataset(web[0])
    _put(web[1], a=b"x" * 1_000_000)
    if mirrored:
        monkeypatch.setenv("WILDLAB_DATA_MIRROR", str(web[1]))
    with pytest.raises(WildlabError, match=r"larger than the 4|more than 4"):
        fetch("small")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["web"]


def test_a_link_out_of_the_folder_is_not_written_through(web, dataset, tmp_path):
    dataset(web[0])
    _put(web[1])
    mine = tmp_path / "mine.csv"
    mine.write_text("mine")
    (tmp_path / "here" / "small").mkdir(parents=True)
    (tmp_path / "here" / "small" / "a.csv").symlink_to(mine)
    with pytest.raises(WildlabError, match="leaves its folder"):
        fetch("small")
    assert mine.read_text() == "mine"
