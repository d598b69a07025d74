"""One file out: written aside, looked through, and only then named; a zip whose listing says nothing."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import pyzipper

from wildlab.errors import WildlabError

#: Of every file in a zip: no zip can be older, and this one says nothing of when it was made.
_TIME = (1980, 1, 1, 0, 0, 0)
#: For the sender, to be passed on: method 99 is AES, which came to zips late.
OPENED_WITH = (
    "It is encrypted with AES-256. 7-Zip, WinZip, Keka and The Unarchiver open it; do not count on what "
    'Windows or macOS has built in, and `unzip` says "unsupported compression method 99". Tell those who get '
    "it, and send them the password by another way than the file."
)
#: A password is tried offline, as often as whoever has the file can pay for.
SHORTEST = 12


@contextlib.contextmanager
def aside(target: Path) -> Iterator[Path]:
    """A folder beside ``target`` for what is being made; gone afterwards, however it ends."""
    target.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix=".share.", suffix=".part", dir=target.parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def refuse_existing(target: Path, overwrite: bool) -> None:
    """Nothing is overwritten without being asked.

    Raises
    ------
    WildlabError
        Where there is something that may not be replaced.
    """
    if target.is_dir():
        raise WildlabError("is a folder, and a copy is one file", "name a file with --out", file=target)
    if os.path.lexists(target) and not overwrite:
        fix = "name another file with --out, or replace it with --overwrite"
        raise WildlabError("this file is there already", fix, file=target)


def check_password(password: str) -> None:
    """Refuse a password that could be tried out.

    Raises
    ------
    WildlabError
        Where it is too short.
    """
    if len(password) < SHORTEST:
        raise WildlabError(
            f"the password has {len(password)} characters, and whoever has the file can try them all",
            f"take {SHORTEST} or more: four or five words that do not belong together",
        )


def write_zip(path: Path, files: Mapping[str, bytes], password: str | None = None) -> None:
    """Files as a zip; the same files without a password give the same bytes.

    Parameters
    ----------
    path
        Of the zip.
    files
        Content by name.
    password
        With it, what is inside is encrypted with AES-256; the names are not.
    """
    with pyzipper.AESZipFile(path, "w", compression=pyzipper.ZIP_DEFLATED) as zipped:
        if password is not None:
            zipped.setpassword(password.encode("utf-8"))
            # Version 2: the first one writes a checksum of what is inside where everybody can read it.
            zipped.setencryption(pyzipper.WZ_AES, nbits=256, force_wz_aes_version=2)
        for name, content in files.items():
            info = pyzipper.zipfile_aes.AESZipInfo(name, date_time=_TIME)
            info.compress_type = pyzipper.ZIP_DEFLATED
            info.create_system, info.external_attr = 3, 0o644 << 16
            zipped.writestr(info, content)


def put(made: Path, target: Path, overwrite: bool) -> None:
    """Give a finished file its name.

    Raises
    ------
    WildlabError
        Where something came into its place meanwhile.
    """
    refuse_existing(target, overwrite)
    made.chmod(0o644)
    made.replace(target)
