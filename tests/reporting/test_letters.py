"""Fonts in PDF figures: what a reader sees is there, and what only costs time is not."""

from __future__ import annotations

import io
import re
import zlib
from pathlib import Path

import numpy as np
import pytest
from fontTools.pens.recordingPen import DecomposingRecordingPen
from fontTools.subset import Options
from fontTools.ttLib import TTFont
from matplotlib.font_manager import findfont

from wildlab.reporting.figures import QUICK, new_figure, save_figure


def fonts_in(pdf: bytes) -> list[TTFont]:
    found = []
    for begin in re.finditer(rb"stream\r?\n", pdf):
        try:
            content = zlib.decompressobj().decompress(pdf[begin.end() :])
        except zlib.error:
            continue
        if content[:4] in (b"\x00\x01\x00\x00", b"true"):
            found.append(TTFont(io.BytesIO(content)))
    return found


def outline(font: TTFont, name: str) -> list[object]:
    glyphs = font.getGlyphSet()
    pen = DecomposingRecordingPen(glyphs)
    glyphs[name].draw(pen)
    return list(pen.value)


def test_an_embedded_font_has_the_letters_and_not_what_sets_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(QUICK, raising=False)
    usual = list(Options._drop_tables_default)
    figure, ax = new_figure()
    ax.plot(np.arange(3))
    ax.set_title("Affen, office: AVAST at 12 m")
    save_figure(figure, tmp_path, "letters")
    fonts = fonts_in((tmp_path / "letters.pdf").read_bytes())
    assert fonts, "no TrueType font is embedded: journals do not take it"
    for font in fonts:
        assert not {"GSUB", "GPOS", "GDEF", "kern"} & set(font.keys())
    assert Options._drop_tables_default == usual
    shapes = [outline(font, name) for font in fonts for name in font.getGlyphOrder()]
    whole = TTFont(findfont(ax.title.get_fontproperties()))
    names = whole.getBestCmap()
    for letter in set("Affen, office: AVAST at 12 m") - {" ", "f", "i"}:  # these three may stand as one sign
        assert outline(whole, names[ord(letter)]) in shapes, letter
