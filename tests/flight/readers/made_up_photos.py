"""Images that no camera took, with the tags that cameras write: for tests of their reader."""

import io
import struct
from pathlib import Path
from typing import Any

from PIL import Image

DJI = 'xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/"'
PIX4D = 'xmlns:Camera="http://pix4d.com/camera/1.0/"'
PARROT = 'xmlns:drone-parrot="http://www.parrot.com/drone-parrot/1.0/"'
FLIR = 'xmlns:FLIR="http://ns.flir.com/xmp/1.0/"'


def exif_of(main: dict[int, Any] | None = None, own: dict[int, Any] | None = None, gps: Any = None) -> Any:
    """EXIF with tags by their numbers: of the image, of the exposure, of GPS."""
    exif = Image.Exif()
    for number, value in (main or {}).items():
        exif[number] = value
    for pointer, tags in ((0x8769, own), (0x8825, gps)):
        if tags:
            exif.get_ifd(pointer).update(tags)
    return exif


def degrees(value: float) -> tuple[float, float, float]:
    """As GPS has angles in EXIF: without their sign."""
    value = abs(value)
    minutes = (value - int(value)) * 60
    return float(int(value)), float(int(minutes)), (minutes - int(minutes)) * 60


def gps_of(latitude: float, longitude: float, height: float | None = None, **more: Any) -> dict[int, Any]:
    """Tags of GPS; `more` by name: ref (of the height), date, clock."""
    found: dict[int, Any] = {
        1: "N" if latitude >= 0 else "S",
        2: degrees(latitude),
        3: "E" if longitude >= 0 else "W",
        4: degrees(longitude),
    }
    if height is not None:
        found |= {5: bytes([more.get("ref", 0)]), 6: abs(height)}
    if "date" in more:
        found |= {29: more["date"], 7: more["clock"]}
    return found


def xmp_of(spaces: str, attributes: dict[str, Any], elements: str = "") -> bytes:
    """A packet of XMP, properties as attributes, and perhaps others as elements."""
    said = " ".join(f'{name}="{value}"' for name, value in attributes.items())
    rdf = 'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"'
    return (
        f'<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        f'<rdf:RDF {rdf}><rdf:Description rdf:about="" {spaces} {said}>{elements}</rdf:Description></rdf:RDF>'
        f'</x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def segment(marker: int, body: bytes) -> bytes:
    return bytes([0xFF, marker]) + struct.pack(">H", len(body) + 2) + body


def jpeg(size: tuple[int, int] = (40, 30), exif: Any = None, xmp: bytes = b"", more: bytes = b"") -> bytes:
    """Bytes of a JPEG; `more` are further segments."""
    stream = io.BytesIO()
    Image.new("L", size, 90).save(stream, "JPEG")
    plain = stream.getvalue()
    parts = b""
    if exif is not None:
        parts = segment(0xE1, b"Exif\0\0" + exif.tobytes().removeprefix(b"Exif\0\0"))
    if xmp:
        parts += segment(0xE1, b"http://ns.adobe.com/xap/1.0/\0" + xmp)
    return plain[:2] + parts + more + plain[2:]


def tiff(exif: Any, size: tuple[int, int] = (12, 8)) -> bytes:
    """Bytes of a TIFF with tags and a size, and no image."""
    exif[0x0100], exif[0x0101] = size
    exif[0x0111], exif[0x0117] = 0, 1
    return bytes(exif.tobytes().removeprefix(b"Exif\0\0"))


def write(folder: Path, name: str, **what: Any) -> Path:
    path = folder / name
    path.write_bytes(jpeg(**what))
    return path


def dji(number: int, latitude: float = 61.5, longitude: float = -15.25, **more: Any) -> dict[str, Any]:
    """EXIF and XMP of an image of a DJI, one a second; `more` are further properties of drone-dji."""
    tags = {
        "drone-dji:AbsoluteAltitude": "+345.50",
        "drone-dji:RelativeAltitude": "+80.00",
        "drone-dji:GimbalRollDegree": "+0.00",
        "drone-dji:GimbalPitchDegree": "-89.90",
        "drone-dji:GimbalYawDegree": "+140.70",
        "drone-dji:FlightRollDegree": "-1.20",
        "drone-dji:FlightPitchDegree": "+3.40",
        "drone-dji:FlightYawDegree": "+139.10",
        **{f"drone-dji:{name}": value for name, value in more.items()},
    }
    own = {0x9003: f"2024:06:12 11:30:{number:02d}", 0x920A: 4.5, 0xA405: 24}
    main = {0x010F: "DJI", 0x0110: "FC6310"}
    return {"exif": exif_of(main, own, gps_of(latitude, longitude, 340.0)), "xmp": xmp_of(DJI, tags)}
