"""A text in every format that is looked into, made by the programs that usually make it."""

from __future__ import annotations

import base64
import bz2
import gzip
import html
import io
import json
import lzma
import sqlite3
import struct
import tarfile
import tempfile
import urllib.parse
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import pyarrow as arrow
import pyarrow.feather
import pyarrow.parquet
from matplotlib.figure import Figure
from PIL import Image, PngImagePlugin

NO_TIME = (1980, 1, 1, 0, 0, 0)


def picture() -> Image.Image:
    return Image.fromarray(np.arange(48 * 32 * 3, dtype=np.uint8).reshape(48, 32, 3))


def saved(image: Image.Image, kind: str, **options: Any) -> bytes:
    out = io.BytesIO()
    image.save(out, kind, **options)
    return out.getvalue()


def exif_text(text: str) -> bytes:
    exif = Image.Exif()
    exif[0x010E] = text
    return exif.tobytes()


def _png_text(text: str, *, packed: bool) -> bytes:
    info = PngImagePlugin.PngInfo()
    info.add_text("Comment", text, zip=packed)
    return saved(picture(), "PNG", pnginfo=info)


def _png_international(text: str) -> bytes:
    info = PngImagePlugin.PngInfo()
    info.add_itxt("Description", text, zip=True)
    return saved(picture(), "PNG", pnginfo=info)


def zipped(name: str, data: bytes, *, comment: bytes = b"", extra: bytes = b"", note: bytes = b"") -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        entry = zipfile.ZipInfo(name, NO_TIME)
        entry.compress_type, entry.extra, entry.comment = zipfile.ZIP_DEFLATED, extra, note
        archive.writestr(entry, data)
        archive.comment = comment
    return out.getvalue()


def _tar(text: str) -> bytes:
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w:gz") as archive:
        entry = tarfile.TarInfo("page.bin")
        data = gzip.compress(text.encode(), mtime=0)
        entry.size = len(data)
        archive.addfile(entry, io.BytesIO(data))
    return out.getvalue()


def figure(text: str, kind: str, **options: Any) -> bytes:
    fig = Figure(figsize=(3, 2))
    axes = fig.subplots()
    axes.plot(np.linspace(0, 1, 50), np.random.default_rng(1).normal(size=50))
    axes.set_title(text)
    out = io.BytesIO()
    with matplotlib.rc_context(options):
        fig.savefig(out, format=kind, metadata={"CreationDate": None} if kind == "pdf" else {"Date": None})
    return out.getvalue()


def _pdf_title(text: str) -> bytes:
    out = io.BytesIO()
    Figure(figsize=(1, 1)).savefig(out, format="pdf", metadata={"Title": text, "CreationDate": None})
    return out.getvalue()


def pdf_of_glyphs(text: str) -> bytes:
    """As browsers write PDFs: numbers of glyphs, and a map from them to letters."""
    letters = sorted(set(text))
    table = "\n".join(f"<{k + 3:04X}> <{ord(letter):04X}>" for k, letter in enumerate(letters))
    shown = "".join(f"{letters.index(letter) + 3:04X}" for letter in text)
    pieces = []
    for number, body in enumerate(
        (
            f"1 beginbfchar\n{table}\nendbfchar".encode(),
            f"BT /F1 9 Tf 1 0 0 1 9 9 Tm <{shown}> Tj ET\n".encode(),
        ),
        1,
    ):
        packed = zlib.compress(body)
        head = f"{number} 0 obj\n<</Length {len(packed)} /Filter /FlateDecode>>\nstream\n".encode()
        pieces.append(head + packed + b"\nendstream\nendobj\n")
    return b"%PDF-1.7\n" + b"".join(pieces) + b"trailer\n%%EOF\n"


def notebook(output: dict[str, Any]) -> bytes:
    cell = {"cell_type": "code", "metadata": {}, "source": [], "execution_count": 1, "outputs": [output]}
    return json.dumps({"cells": [cell], "metadata": {}, "nbformat": 4, "nbformat_minor": 5}).encode()


def parquet(table: Any, **options: Any) -> bytes:
    out = io.BytesIO()
    arrow.parquet.write_table(table, out, **options)
    return out.getvalue()


def _arrow_file(text: str) -> bytes:
    out = io.BytesIO()
    arrow.feather.write_feather(arrow.table({"note": [text] * 3}), out, compression="lz4")
    return out.getvalue()


def sqlite(made: str, rows: list[tuple[Any, ...]], *, deleted: bool = False) -> bytes:
    with sqlite3.connect(":memory:") as base:
        base.execute("PRAGMA secure_delete = OFF")
        base.execute(f"CREATE TABLE points ({made})")
        marks = ",".join("?" * len(rows[0]))
        base.executemany(f"INSERT INTO points VALUES ({marks})", rows)  # noqa: S608 - question marks only
        if deleted:
            base.execute("DELETE FROM points")
        base.commit()
        return bytes(base.serialize())


def recording(fill: Callable[[Any], None]) -> bytes:
    import rerun

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "replay.rrd"
        stream = rerun.RecordingStream("wildlab")
        stream.save(path)
        fill(stream)
        stream.flush()
        stream.disconnect()
        return path.read_bytes()


def _recorded_text(text: str) -> bytes:
    import rerun

    return recording(lambda stream: stream.log("notes", rerun.TextLog(text), static=True))


def _extra(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<HH", 0x9999, len(data)) + data


def _wide_in_binary(text: str) -> bytes:
    return b"\x01\x00\xff\x07\x81" * 20 + text.encode("utf-16-le") + b"\x00\x01\x02\xf0" * 20


# ruff: noqa: E501 - one format a line
PACKED: dict[str, Callable[[str], bytes]] = {
    "plain text": lambda text: text.encode(),
    "UTF-16 with a mark": lambda text: text.encode("utf-16"),
    "UTF-16 without": lambda text: text.encode("utf-16-be"),
    "UTF-32": lambda text: text.encode("utf-32"),
    "Latin-1": lambda text: ("æøå " + text).encode("latin-1"),
    "wide letters in binary": _wide_in_binary,
    "HTML, each letter an entity": lambda text: "".join(f"&#{ord(c)};" for c in text).encode(),
    "HTML, hexadecimal entities": lambda text: "".join(f"&#x{ord(c):x};" for c in text).encode(),
    "HTML, tags between": lambda text: ("<p>" + "<b></b>".join(text) + "</p>").encode(),
    "JSON escapes": lambda text: ('"' + "".join(f"\\u{ord(c):04x}" for c in text) + '"').encode(),
    "percent-encoded": lambda text: "".join(f"%{ord(c):02X}" for c in text).encode(),
    "data address": lambda text: b'<img src="data:text/plain,' + urllib.parse.quote(text).encode() + b'">',
    "data address, base64": lambda text: b"url(data:text/plain;base64," + base64.b64encode(text.encode()) + b")",
    "base64 of base64": lambda text: base64.b64encode(b"-- " + base64.b64encode(text.encode())),
    "base64, broken lines": lambda text: json.dumps({"a": base64.encodebytes(text.encode() * 9).decode()}).encode(),
    "base64 for addresses": lambda text: b"?q=" + base64.urlsafe_b64encode(b"\xfb\xef\xbe " + text.encode()),
    "hexadecimal": lambda text: b"x " + text.encode().hex().encode() + b" y",
    "gzip": lambda text: gzip.compress(text.encode(), mtime=0),
    "zlib": lambda text: zlib.compress(text.encode() * 3),
    "zlib inside of bytes": lambda text: b"\x00\x01\x7f" * 30 + zlib.compress(text.encode() * 3),
    "bzip2": lambda text: bz2.compress(text.encode()),
    "xz": lambda text: lzma.compress(text.encode()),
    "Zstandard": lambda text: arrow.compress(text.encode(), "zstd", asbytes=True),
    "zip": lambda text: zipped("a.txt", text.encode()),
    "zip in a zip": lambda text: zipped("a.zip", zipped("b.txt", text.encode())),
    "zip, name of an entry": lambda text: zipped(text.replace("/", "-") + ".txt", b"nothing"),
    "zip, comment": lambda text: zipped("a", b"", comment=text.encode()),
    "zip, comment of an entry": lambda text: zipped("a", b"", note=text.encode()),
    "zip, extra field": lambda text: zipped("a", b"", extra=_extra(text)),
    "zip behind a picture": lambda text: saved(picture(), "PNG") + zipped("a.txt", text.encode()),
    "tar.gz": _tar,
    "PNG, tEXt": lambda text: _png_text(text, packed=False),
    "PNG, zTXt": lambda text: _png_text(text, packed=True),
    "PNG, iTXt": _png_international,
    "PNG, eXIf": lambda text: saved(picture(), "PNG", exif=exif_text(text)),
    "PNG, behind its end": lambda text: saved(picture(), "PNG") + text.encode(),
    "JPEG, comment": lambda text: saved(picture(), "JPEG", comment=text.encode()),
    "JPEG, EXIF": lambda text: saved(picture(), "JPEG", exif=exif_text(text)),
    "JPEG, XMP": lambda text: saved(picture(), "JPEG", xmp=f"<x:xmpmeta>{html.escape(text)}</x:xmpmeta>".encode()),
    "JPEG, behind its end": lambda text: saved(picture(), "JPEG") + saved(picture(), "JPEG", comment=text.encode()),
    "WebP, EXIF": lambda text: saved(picture(), "WEBP", exif=exif_text(text)),
    "WebP, XMP": lambda text: saved(picture(), "WEBP", xmp=text.encode()),
    "GIF, comment": lambda text: saved(picture().convert("P"), "GIF", comment=text.encode()),
    "TIFF": lambda text: saved(picture(), "TIFF", description=text),
    "TIFF, packed": lambda text: saved(picture(), "TIFF", description=text, compression="tiff_deflate"),
    "PDF, drawn text": lambda text: figure(text, "pdf"),
    "PDF, drawn text, whole fonts": lambda text: figure(text, "pdf", **{"pdf.fonttype": 42}),
    "PDF, title": _pdf_title,
    "PDF, glyphs": pdf_of_glyphs,
    "SVG": lambda text: figure(text, "svg", **{"svg.fonttype": "none"}),
    "notebook, text": lambda text: notebook({"output_type": "stream", "name": "stdout", "text": [text]}),
    "notebook, HTML": lambda text: notebook(
        {"output_type": "display_data", "metadata": {}, "data": {"text/html": f"<b>{html.escape(text)}</b>"}}
    ),
    "notebook, PNG": lambda text: notebook(
        {
            "output_type": "display_data",
            "metadata": {},
            "data": {"image/png": base64.encodebytes(_png_text(text, packed=True)).decode()},
        }
    ),
    "Parquet, column": lambda text: parquet(arrow.table({"note": [text] * 3})),
    "Parquet, few different": lambda text: parquet(
        arrow.Table.from_pandas(pd.DataFrame({"a": pd.Categorical([text] * 9)})), compression="zstd"
    ),
    "Parquet, nested": lambda text: parquet(arrow.table({"a": [[{"b": text}]]}), compression="gzip"),
    "Parquet, metadata": lambda text: parquet(arrow.table({"a": [1]}).replace_schema_metadata({"note": text})),
    "Parquet, name of a column": lambda text: parquet(arrow.table({text: [1]})),
    "Arrow": _arrow_file,
    "SQLite": lambda text: sqlite("note TEXT", [(text,)]),
    "SQLite, deleted row": lambda text: sqlite("note TEXT", [(text,)], deleted=True),
    "SQLite, packed cell": lambda text: sqlite("note BLOB", [(gzip.compress(text.encode() * 5, mtime=0),)]),
    "rerun recording": _recorded_text,
    "NumPy archive": lambda text: _npz(text),
}  # fmt: skip


def _npz(text: str) -> bytes:
    out = io.BytesIO()
    np.savez_compressed(out, note=np.array([text]))
    return out.getvalue()
