"""What a file seems to be that no reader claims, by its first bytes or words: for the refusal."""

from __future__ import annotations

import re

#: First bytes, what writes them, and what to do.
_BYTES = (
    (b"\x89HDF", "an HDF5 or NetCDF file", "export one spectrum as text (SeaBASS, or columns)"),
    (b"CDF", "a NetCDF file", "export one spectrum as text (SeaBASS, or columns)"),
    (b"\xd0\xcf\x11\xe0", "an old Excel or Access file", "save it as CSV"),
    (b"PK\x03\x04", "a zip archive or an Excel file", "save it as CSV, or unpack it"),
    (b"%PDF", "a PDF", "export the numbers as text"),
    (b"\x89PNG", "a picture", "name the spectrum's file"),
    (b"\xff\xd8\xff", "a picture", "name the spectrum's file"),
    (b"\x76\x2f\x31\x01", "an OpenEXR picture", "name the spectrum's file"),
    (b"AVS8", "a binary file of AvaSoft 8", "export it as text from AvaSoft"),
    (b"\n\n\xfe\xfe", "a file of Bruker OPUS", "export it as text"),
    (b"ASD", "a binary file of an ASD FieldSpec", "convert it with ASD's ViewSpec to text"),
    (b"as7", "a binary file of an ASD FieldSpec", "convert it with ASD's ViewSpec to text"),
    (b"MATLAB ", "a MATLAB file", "write wavelength and value as text (writematrix)"),
    (b"\x1f\x8b", "a file packed by gzip", "unpack it"),
    (b"SIMPLE  =", "a FITS file", "export wavelength and value as columns"),
    (b"SQLite format 3", "a database", "export one spectrum as text"),
)
_WORDS = (
    (r"##title\s*=", "a JCAMP-DX file", "export it as text with a header"),
    (
        r"%slaveaddress|%c001",
        "raw counts of a TriOS RAMSES, which have no wavelengths",
        "export it CALIBRATED",
    ),
    (r"\[calib", "a calibration, no measurement", "name the spectrum's file"),
    (r"\s*(instrument|vlf_instrument)\s+sat", "a Satlantic calibration", "name the .raw file beside it"),
    (r"/\*\*\* spectra vista", "a file of a Spectra Vista (SVC)", "export wavelength and value as columns"),
    (r"enlighten version", "a file of Wasatch ENLIGHTEN", "say which columns hold wavelength and value"),
    (r"\s*[{<]", "JSON, XML or a web page", "export it as columns of text"),
    (r"\s*\[(lamp|water|tank|detector)\]", "a scene", "name the spectrum's file"),
    (r"(.*,)?z_m,(.*,)?value(,|$)", "a reading table already", "give it to diagnose as it is"),
)


#: Formats that have no mark of their own, by the ends of their files' names.
_SUFFIXES = {
    **dict.fromkeys(
        (".trm", ".roh", ".drk", ".ref", ".abs", ".tfs", ".rcm", ".irr"),
        ("a binary file of AvaSoft", "export it as text from AvaSoft"),
    ),
    ".spc": ("a Thermo Galactic SPC file", "export it as text with a header"),
}


def what_it_seems(data: bytes, where: str = "") -> tuple[str, str]:
    """What it seems to be, and the remedy; "" where nothing is known of it."""
    suffix = re.search(r"\.\w+$", where.lower())
    if b"\0" in data[:200] and suffix and suffix[0] in _SUFFIXES:
        return _SUFFIXES[suffix[0]]
    for start, what, remedy in _BYTES:
        if data.startswith(start):
            return what, remedy
    head = data[:4000].decode("latin-1").lower()
    for pattern, what, remedy in _WORDS:
        if re.search(rf"^{pattern}", head, re.MULTILINE):
            return what, remedy
    return "", ""
