"""What `pyproject.toml` cannot say: notebooks, data and the lock lie beside the package and travel inside it.

An installation in place (``pip install --editable``) copies nothing: `wildlab.paths` finds the checkout.
"""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

FOLDERS = ("notebooks", "data")
#: A working copy also holds tables and pictures that somebody left there; these kinds alone are wildlab's.
KINDS = {".ipynb", ".json", ".toml", ".md", ".css", ".html", ".js", ".mplstyle", ".sql", ".svg"}


def resources() -> list[Path]:
    """The files that travel, relative to this folder: no downloads, nothing hidden."""
    inside = [path for folder in FOLDERS for path in sorted(Path(folder).rglob("*")) if path.suffix in KINDS]
    chosen = [
        path
        for path in inside
        if path.is_file()
        and not path.is_relative_to("data/fetched")
        and not any(part.startswith(".") for part in path.parts)
    ]
    return [*chosen, Path("environment.lock")]


class BuildWithResources(build_py):
    def run(self) -> None:
        if self.editable_mode:
            super().run()
            return
        # setuptools leaves what it built the last time, also modules that have been renamed since.
        shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()
        for path in resources():
            target = Path(self.build_lib) / "wildlab" / "resources" / path
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)

    def get_source_files(self) -> list[str]:
        """What a source distribution needs: without it no wheel could be built from one."""
        return [*super().get_source_files(), *map(str, resources())]


setup(cmdclass={"build_py": BuildWithResources})
