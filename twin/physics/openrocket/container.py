"""The XML document in an OpenRocket file, which is a ZIP archive, gzip, or plain XML."""

import gzip
import io
import zipfile
import zlib
from pathlib import Path
from typing import IO, Final
from xml.etree.ElementTree import Element

from analysis.files import FileError, content
from twin.physics import safe_xml
from twin.physics.vehicle.design import VehicleError

LARGEST_FILE: Final = 20_000_000  # bytes; the largest of 40 public designs has 0.9 MB
LARGEST_XML: Final = 40_000_000
# zipfile expands other kinds without regard to the length asked for
BOUNDED: Final = zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED
DOCUMENT: Final = "rocket.ork"  # in the archive, beside textures and thumbnails


def document(path: Path) -> Element:
    """Root element of a design.

    Raises
    ------
    VehicleError : it cannot be read, exceeds a limit, or is not an OpenRocket design
    """
    try:
        root = safe_xml.parsed(_xml(content(path, LARGEST_FILE)), LARGEST_XML)
    except (FileError, safe_xml.XmlError) as error:
        text = str(error)
        raise VehicleError(text if text.startswith(str(path)) else f"{path}: {text}") from None
    except (zipfile.BadZipFile, OSError, EOFError, zlib.error, RuntimeError, ValueError) as error:
        raise VehicleError(f"{path}: a damaged archive: {str(error)[:100]}") from None
    if root.tag != "openrocket" or root.find("rocket") is None:
        raise VehicleError(f"{path}: not an OpenRocket design; its root is <{root.tag[:40]}>")
    return root


def _xml(data: bytes) -> bytes:
    if data[:2] == b"\x1f\x8b":
        with gzip.open(io.BytesIO(data)) as stream:
            return _bounded(stream)
    if data[:2] != b"PK":
        return data
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = archive.namelist()
        designs = [DOCUMENT] if DOCUMENT in names else [n for n in names if n.endswith(".ork")]
        if not designs:
            raise zipfile.BadZipFile(f"it holds no {DOCUMENT}")
        info = archive.getinfo(designs[0])
        if info.compress_type not in BOUNDED:
            raise zipfile.BadZipFile("its document must be stored or deflated, as OpenRocket does")
        with archive.open(info) as stream:
            return _bounded(stream)


def _bounded(stream: IO[bytes] | gzip.GzipFile) -> bytes:
    """At most one byte more than allowed, however much the archive would expand to."""
    return stream.read(LARGEST_XML + 1)
