"""One file out, made in memory and looked through before it is written; a zip whose listing says nothing."""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import pyzipper

from wildlab.errors import WildlabError
from wildlab.files import write_atomic

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


#: Waits until the process that started it is gone, however it ended, and removes a folder until it stays
#: away: what that process had started may still write into it.
_WATCH = """
import os, shutil, sys, time
sys.stdin.buffer.read()
for _ in range(20):
    if not os.path.lexists(sys.argv[1]):
        break
    shutil.rmtree(sys.argv[1], ignore_errors=True)
    time.sleep(0.25)
"""


@contextlib.contextmanager
def private_folder() -> Iterator[Path]:
    """A folder among the system's temporary ones that nobody else may open; gone afterwards, however it ends.

    A process of its own watches over it, so that nothing is left where this one is killed.
    """
    with tempfile.TemporaryDirectory(prefix="wildlab-share-") as folder:
        command = [sys.executable, "-I", "-S", "-c", _WATCH, folder]
        watch = subprocess.Popen(  # noqa: S603 - our own words
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True, cwd=tempfile.gettempdir(),
        )  # fmt: skip
        try:
            yield Path(folder)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            watch.communicate()


def refuse_existing(target: Path, overwrite: bool) -> None:
    """Nothing is overwritten without being asked; and what nothing can be written into is no place.

    Raises
    ------
    WildlabError
        Where there is something that may not be replaced, or no folder that can be written to.
    """
    folder = next(one for one in target.absolute().parents if os.path.lexists(one))
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise WildlabError("nothing can be written here", "name a file elsewhere with --out", file=folder)
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


def zip_bytes(files: Mapping[str, bytes], password: str | None = None) -> bytes:
    """Files as a zip, which lies nowhere yet; the same files without a password give the same bytes.

    Parameters
    ----------
    files
        Content by name.
    password
        With it, what is inside is encrypted with AES-256; the names are not.
    """
    whole = io.BytesIO()
    with pyzipper.AESZipFile(whole, "w", compression=pyzipper.ZIP_DEFLATED) as zipped:
        if password is not None:
            zipped.setpassword(password.encode("utf-8"))
            # Version 2: the first one writes a checksum of what is inside where everybody can read it.
            zipped.setencryption(pyzipper.WZ_AES, nbits=256, force_wz_aes_version=2)
        for name, content in files.items():
            info = pyzipper.zipfile_aes.AESZipInfo(name, date_time=_TIME)
            info.compress_type = pyzipper.ZIP_DEFLATED
            info.create_system, info.external_attr = 3, 0o644 << 16
            zipped.writestr(info, content)
    return whole.getvalue()


def put(content: bytes, target: Path, overwrite: bool) -> None:
    """Write a finished file, whole or not at all.

    Raises
    ------
    WildlabError
        Where something came into its place meanwhile.
    """
    refuse_existing(target, overwrite)
    target.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(target, content)
