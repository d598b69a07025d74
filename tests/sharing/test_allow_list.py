"""The first wall: only what is known to be ours is written, and all else is refused, with where it stands."""

from __future__ import annotations

# ruff: noqa: E501 - elements and attributes as they stand in a page
import base64
import gzip
import io
import re
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bs4 import BeautifulSoup
from PIL import Image, PngImagePlugin

from tests.sharing.spelt import CODED, DATES, LATITUDE, LEAKS, LONGITUDE, WHEN, secrets
from wildlab.errors import RunFailed, WildlabError
from wildlab.reporting.text import page
from wildlab.sharing.allow_list import first_foreign_word, read_part
from wildlab.sharing.scan import SecretSearch


def picture() -> Image.Image:
    return Image.fromarray(np.arange(48 * 32 * 3, dtype=np.uint8).reshape(48, 32, 3))


def saved(image: Image.Image, kind: str, **options: Any) -> bytes:
    out = io.BytesIO()
    image.save(out, kind, **options)
    return out.getvalue()


LEAK = "; ".join(text for _, text in LEAKS.values())


def written(folder: Path, body: str | bytes, *, generalised: bool = True) -> str:
    path = folder / "report.html"
    if isinstance(body, bytes):
        before, after = page(title="x", body="<h1>Report</h1>|").split("|")
        path.write_bytes(before.encode() + body + after.encode())
    else:
        path.write_text(page(title="x", body=f"<h1>Report</h1>{body}"), encoding="utf-8")
    return read_part(path, 1, exact=False, generalised=generalised).body


PLAIN = "<p>The mean error is 6.4 m.</p>"
PIXELS = base64.b64encode(saved(picture(), "PNG")).decode()
TABLE = base64.b64encode(b"stream,n,rate\nnav/poses-1,8801,9.5\n").decode()
OURS = f"""<section class="summary warn" aria-label="Summary"><p>The mean error is <b>6.4</b> m (5.9 to 7.0).</p></section>
<h2 id="every-track">Every track</h2><p>See <a class="word" href="#every-track">track</a> of target-2, −0.30 m.</p>
<figure class="table"><div class="scroll" role="group" tabindex="0" aria-label="Figure 1"><table class="many"
role="table"><thead role="rowgroup"><tr role="row"><th role="columnheader" scope="col">filter</th></tr></thead>
<tbody role="rowgroup"><tr role="row"><td role="cell" class="text" data-label="filter">12 %</td></tr></tbody></table>
</div><figcaption><a class="data" download="flight-table-1.csv" href="data:text/csv;base64,{TABLE}">CSV</a></figcaption>
</figure><svg class="strip" viewBox="0 0 160 18" role="img" aria-label="ratio 1.25"><path class="axis"
d="M369.2 245.6L368.1 244"/><circle class="published" cx="80" cy="9" r="4.6"/><rect class="range" x="60.1" y="6"
width="40" height="6" rx="3"/></svg>
<img alt="Map of the path" width="457" height="525" style="max-width:457px;min-width:283px"
src="data:image/png;base64,{PIXELS}">"""


def test_what_is_ours_is_written(tmp_path):
    soup = BeautifulSoup(written(tmp_path, OURS), "html.parser")
    assert soup.get_text(" ", strip=True).startswith("Report The mean error is 6.4 m (5.9 to 7.0).")
    assert [tag["id"] for tag in soup.find_all(id=True)] == ["r1-every-track"]
    links = [str(tag["href"]) for tag in soup.find_all("a")]
    assert links[0] == "#r1-every-track" and TABLE in links[1]
    assert soup.find("path")["d"] == "M369.2 245.6L368.1 244"  # type: ignore[index]
    image = soup.find("img")
    there = base64.b64decode(str(image["src"]).partition(",")[2])  # type: ignore[index]
    np.testing.assert_array_equal(np.array(Image.open(io.BytesIO(there))), np.array(picture()))


def refused(folder: Path, body: str) -> WildlabError:
    with pytest.raises(RunFailed, match="there is no copy") as caught:
        written(folder, body)
    error = caught.value
    assert error.file == str(folder / "report.html") and error.field and error.fix
    return error


@pytest.mark.parametrize(
    "body",
    [
        "<script>1</script>", "<iframe src='x'></iframe>", "<object data='x'></object>", "<embed src='x'>",
        "<form><input></form>", "<template>x</template>", "<link href='x'>",
        "<base href='x'>", "<custom-thing>1</custom-thing>",
        "<svg><image href='x'/></svg>", "<svg><foreignObject>1</foreignObject></svg>", "<svg><use href='#a'/></svg>",
        "<svg><metadata>1</metadata></svg>",
        "<![CDATA[ x ]]>", "<?php x ?>", "<math><annotation>x</annotation></math>",
    ],
)  # fmt: skip
def test_an_unknown_element_is_refused(body, tmp_path):
    refused(tmp_path, f"{PLAIN}<div>{body}</div>")


@pytest.mark.parametrize(
    "given",
    [
        "onclick='x'", "data-x='1'", "srcset='x'",
        "style='background:url(x)'", "style='--a: 63.4'", "class='Skukuza'", "class='a/b'", "id='skukuza'",
        "aria-label='near Skukuza'", "title='at 24.87 S, seen by Jonas'", "tabindex='63.41798'", "width='63.41798%'",
        "d='M63.4179 10.3912'", "d='M6224.8 1241.0'", "points='1,2 6224.828,1241'", "values='63.41798;10.3912'",
        "transform='translate(63.4179 10.3912)'", "keytimes='0;63.4179'", "role='a.b'", "xmlns='http://x'",
        "href='javascript:1'", "href='data:text/html;base64,YQ=='", "open='63.4'", "alt='Thandi'",
        "download='skukuza.csv'", "download='../a.csv'", "viewbox='63.4179 10.391'",
    ],
)  # fmt: skip
def test_an_unknown_attribute_or_value_is_refused(given, tmp_path):
    name = given.partition("=")[0]
    body = f"{PLAIN}<svg><path {given}/></svg>"
    if name == "href":  # a link out of the page becomes its words
        assert given.partition("=")[2].strip("'") not in written(tmp_path, f"{PLAIN}<a {given}>mean</a>")
        body = f"{PLAIN}<svg><path {given}/></svg>"
    assert name in str(refused(tmp_path, body)) or "says" in str(refused(tmp_path, body))


@pytest.mark.parametrize(
    "words", ["Skukuza", "Thandi the rhino", "u4pruydqqvj", "32VNR69743", "8FVC9G8F+6X", "JN58td"]
)
def test_a_word_that_is_not_ours_is_refused(words, tmp_path):
    assert (
        words.split()[0].casefold()[:5] in str(refused(tmp_path, f"<p>Mean error at {words}.</p>")).casefold()
    )


@pytest.mark.parametrize("spelling", CODED)
def test_codes_are_of_no_form_of_ours(spelling, tmp_path):
    for latitude, longitude in ((LATITUDE, LONGITUDE), (-24.113587, 31.472936), (19.436257, -99.131264)):
        code = CODED[spelling](latitude, longitude)
        assert first_foreign_word(f"it was {code} then"), code
    refused(tmp_path, f"<p>{code.replace('&', '&amp;').replace('<', '&lt;')}</p>")


@pytest.mark.parametrize("way", [way for way in DATES if re.search("[-/:.T_]", way) and " " not in way])
def test_dates_are_of_no_form_of_ours(way):
    assert first_foreign_word(f"on {WHEN.strftime(way)} it")


def test_numbers_as_reports_write_them_are_ours():
    for text in (
        "6.4 m",
        "−0.01",
        "-0.30 to +1.8",
        "12 %",
        "80°",
        "5.68e-11",
        "220001",
        "target-1, poses-2",
        "(63 %)",
    ):
        assert first_foreign_word(text) == "", text
    for text in ("12345678", "1.2.3.4", "9/17/23", "0x3f", "1_000", "63,417", "1e999"):
        assert first_foreign_word(text), text


@pytest.mark.parametrize(
    "table",
    [
        "stream,latitude_of_skukuza\na,1\n", "stream,n\nThandi,1\n", "stream,n\na\n", "n,n 2\n1,2\n",
        "stream,n\n63417982,1\n", "stream,n\n2023-05-17,1\n", 'stream,n\n"a\n',
    ],
)  # fmt: skip
def test_an_unknown_column_or_cell_is_refused(table, tmp_path):
    packed = base64.b64encode(table.encode()).decode()
    refused(tmp_path, f'<p><a download="a.csv" href="data:text/csv;base64,{packed}">CSV</a></p>')


def _chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def test_a_picture_is_its_pixels_and_nothing_else(tmp_path):
    data = saved(picture(), "PNG")
    at = data.index(b"IDAT") - 4
    end = data.index(b"IEND") - 4
    hidden = [
        data[:at] + _chunk(b"tEXt", b"Comment\0Skukuza") + data[at:],
        data[:at] + _chunk(b"prVt", b"Skukuza") + data[at:],
        data[:end] + _chunk(b"IDAT", b"Skukuza") + data[end:],
        data + b"Skukuza", data[:-12], data[:-40], b"Skukuza", b"\xff\xd8\xff" + data[3:],
    ]  # fmt: skip
    for one in hidden:
        source = f"data:image/png;base64,{base64.b64encode(one).decode()}"
        refused(tmp_path, f'<p><img alt="Map" src="{source}"></p>')
    for source in ("a.png", "https://x/a.png", f"data:image/svg+xml;base64,{PIXELS}", "data:image/png,x"):
        refused(tmp_path, f'<p><img alt="Map" src="{source}"></p>')


def test_a_style_is_not_written(tmp_path):
    for style in ("p { color: red }", "p::before { content: 'Skukuza' }", "@import 'x'"):
        assert "{" not in written(tmp_path, f"<style>{style}</style>{PLAIN}")


def test_comments_are_not_written(tmp_path):
    assert "jonas" not in written(tmp_path, f"{PLAIN}<!-- by jonas -->")


def _exif(text: str) -> bytes:
    exif = Image.Exif()
    exif[0x010E] = text
    return saved(picture(), "JPEG", exif=exif.tobytes())


def _png_text(text: str) -> bytes:
    info = PngImagePlugin.PngInfo()
    info.add_text("Comment", text, zip=True)
    return saved(picture(), "PNG", pnginfo=info)


PACKED = {
    "plain text": str.encode,
    "HTML, each letter an entity": lambda text: "".join(f"&#{ord(c)};" for c in text).encode(),
    "JSON escapes": lambda text: ('"' + "".join(f"\\u{ord(c):04x}" for c in text) + '"').encode(),
    "data address": lambda text: b'<img src="data:text/plain,' + text.replace('"', "").encode() + b'">',
    "base64 of base64": lambda text: base64.b64encode(b"-- " + base64.b64encode(text.encode())),
    "hexadecimal": lambda text: b"x " + text.encode().hex().encode() + b" y",
    "gzip": lambda text: gzip.compress(text.encode(), mtime=0),
    "PNG, packed text": _png_text,
    "JPEG, EXIF": _exif,
}


@pytest.mark.parametrize("kind", PACKED)
def test_what_is_packed_goes_nowhere(kind, tmp_path):
    """Leaks in every format: as they are, in the address of a link or picture, and as letters."""
    data = PACKED[kind](LEAK)
    packed = base64.b64encode(data).decode()
    bodies: list[str | bytes] = [
        b"<p>" + data.replace(b"<", b"&lt;") + b"</p>", b"<div>" + data + b"</div>",
        f"<p>{packed}</p>", f"<p>{data.hex()}</p>", f"<p>{data!r}</p>",
        *(f'<p><a download="a.csv" href="data:{one};base64,{packed}">CSV</a></p>'
          for one in ("text/csv", "application/octet-stream", "application/geo+json")),
        *(f'<p><img alt="Map" src="data:{one};base64,{packed}"></p>'
          for one in ("image/png", "image/jpeg", "image/svg+xml")),
    ]  # fmt: skip
    for body in bodies:
        try:
            text = written(tmp_path, body)
        except WildlabError:
            continue
        if SecretSearch(secrets()).scan({"a.html": text}):
            continue
        seen = BeautifulSoup(text, "html.parser").get_text()
        assert packed not in text and "TROLLHOLMEN" not in seen and "2023" not in seen, body


def test_a_study_may_have_other_words_and_no_codes(tmp_path):
    assert "FLIR" in written(
        tmp_path, "<p>FLIR Tau of 2018-06-01T10:00:00Z at 58.662064</p>", generalised=False
    )
    for body in ("<script>1</script>", f"<p>{'QUJD' * 9}1</p>", "<p onclick='1'>x</p>"):
        with pytest.raises(RunFailed, match="no copy"):
            written(tmp_path, f"<div>{body}</div>", generalised=False)
