"""Where things lie, in a checkout and without one. `test_wheel.py` looks at a real installation."""

from wildlab import paths
from wildlab.flight import catalog


def test_a_checkout_is_known_by_what_lies_beside_the_package(tmp_path):
    package = tmp_path / "wildlab"
    (tmp_path / "notebooks").mkdir()
    assert paths.find_checkout(package) is None
    (tmp_path / "notebooks" / "studies.toml").touch()
    assert paths.find_checkout(package) is None
    (tmp_path / "pyproject.toml").touch()
    assert paths.find_checkout(package) == tmp_path


def test_public_data_of_an_installed_wildlab_go_to_the_cache(tmp_path, monkeypatch):
    monkeypatch.setattr(paths, "ROOT", None)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / ".cache"))
    folder = catalog.dataset_folder("openathena")
    assert folder.is_relative_to(tmp_path) and folder.parts[-2:] == ("fetched", "openathena")
    assert "wildlab" in folder.relative_to(tmp_path).parts
