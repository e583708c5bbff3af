"""Files of other makers' instruments, made up after the facts of their formats, with one known spectrum."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from lightfield.readings.instruments.spectrum import Spectrum

WAVELENGTH = np.round(400 + 0.75 * np.arange(40), 2)
COUNTS = np.round(1200 + 900 * np.exp(-(((WAVELENGTH - 415) / 6) ** 2)), 3)
DARK = np.round(1150 + 3 * np.sin(WAVELENGTH), 3)


def rows(*columns, separator="\t", mark=".") -> str:
    return "".join(
        separator.join(f"{cell:.3f}".replace(".", mark) for cell in row) + "\n"
        for row in zip(*columns, strict=True)
    )


def spanish() -> str:
    """Words of a Spanish SpectraSuite: only the arrows are those of the English one."""
    return (
        "Fichero De Datos De SpectraSuite\n++++++++\nFecha: Thu Apr 20 21:15:04 CEST 2017\n"
        "Espectrómetros: TEST1\nTiempo de integración (usec): 70000 (TEST1)\n"
        "Promedio de Espectros Hechos un: 15 (TEST1)\nEl Alisar Del Furgón: 5 (TEST1)\n"
        f"Procesado del espectro de Número de pixeles en: {len(WAVELENGTH)}\n"
        ">>>>> Comienza Data<<<<< Espectral Procesado Del EL\n"
        + rows(WAVELENGTH, COUNTS, mark=",")
        + ">>>>> Data<<<<< Espectral Procesado Extremo\n"
    )


def unheard() -> str:
    """A language in no table: the arrows alone tell."""
    return (
        spanish().replace("Comienza", "Qalandi").replace("Extremo", "Naneq").replace("De SpectraSuite", "Qq")
    )


def avantes() -> str:
    return (
        "1305084U1-\nIntegration time: 70.00 ms\nAverage: 15 scans\nNr of pixels used for smoothing: 5\n"
        "Data measured with spectrometer name: TEST1       \n"
        "Wave   ;Dark     ;Ref      ;Sample   ;Transmittance\n"
        "[nm]   ;[counts] ;[counts] ;[counts] ;[% transmittance] \n"
        + rows(WAVELENGTH, DARK, 2 * COUNTS, COUNTS, COUNTS / 20, separator=";")
    )


def avantes8() -> str:
    return (
        "\nIntegration time [ms]:  70.000\nAveraging Nr. [scans]: 15\nSmoothing Nr. [pixels]: 5\n"
        "Data measured with spectrometer [name]: TEST1\nWave   ;Sample   ;Dark     ;Reference;Reflectance\n"
        "[nm]   ;[counts] ;[counts] ;[counts] ;[%]\n\n"
        + rows(WAVELENGTH, COUNTS, DARK, 2 * COUNTS, COUNTS / 20, separator=";")
    )


def seabass() -> str:
    names = ",".join(f"Ed{w:.2f}" for w in WAVELENGTH)
    return (
        "/begin_header\n/instrument_model=TEST1\n/missing=-999\n/delimiter=comma\n! a comment\n"
        f"/fields=date,time,{names}\n/units=yyyymmdd,hh:mm:ss" + ",uW/cm^2/nm" * 40 + "\n/end_header\n"
        + "20200303,11:12:13," + ",".join(f"{c:.3f}" for c in COUNTS) + "\n"
    )  # fmt: skip


def seabass_down() -> str:
    return (
        "/begin_header\n/missing=-999\n/delimiter=space\n/fields=wavelength,Ed,Ed_sd\n"
        "/units=nm,uW/cm^2/nm,uW/cm^2/nm\n/end_header\n"
        + rows(WAVELENGTH, COUNTS, DARK, separator=" ")
    )  # fmt: skip


def ramses() -> str:
    raw = (
        "[Spectrum]\nVersion            = 1\n[Attributes]\n[END] of [Attributes]\n"
        "IDDevice           = SAM_8166\n"
        "IDDataTypeSub1     = RAW\nIntegrationTime    = 70\nUnit1              = $01 $01 Pixel\n"
        "[Data]\n1 2000 0 0\n2 2010 0 0\n[END] of [Data]\n[END] of [Spectrum]\n"
    )
    calibrated = (
        raw.replace("RAW", "CALIBRATED")
        .replace("$01 $01 Pixel", "$05 $01 Wavelength nm\nUnit2              = $03 $05 mW/(m^2 nm)")
        .replace("1 2000 0 0\n2 2010 0 0\n", " 0 70 0 0\n" + "".join(
            f" {w:.3f} {c:.3f} NaN 0\n" for w, c in zip(WAVELENGTH, COUNTS, strict=True)
        ))
    )  # fmt: skip
    return raw + calibrated


def two_columns() -> str:
    return "Integration Time (ms): 70\nwavelength (nm);counts\n" + rows(
        WAVELENGTH, COUNTS, separator=";", mark=","
    )


def bare() -> str:
    return rows(WAVELENGTH, COUNTS, separator="  ")


def across() -> str:
    return (
        "name," + ",".join(f"{w:.2f} nm" for w in WAVELENGTH) + "\n"
        + "".join(f"{k}," + ",".join(f"{c:.3f}" for c in COUNTS) + "\n" for k in (1, 2))
    )  # fmt: skip


TEXTS = {
    "SpectraSuite": spanish, "OceanView": unheard, "Avantes": avantes, "Avantes 8": avantes8,
    "SeaBASS": seabass, "SeaBASS down": seabass_down, "TriOS RAMSES": ramses, "plain columns": two_columns,
    "plain columns bare": bare, "plain columns across": across,
}  # fmt: skip


def procspec(**changed: str) -> bytes:
    def doubles(values) -> str:
        return "".join(f"<double>{v:.3f}</double>" for v in values)

    dark, light = (
        f"<integrationTime>70000</integrationTime><pixelValues>{doubles(v)}</pixelValues>"
        "<boxcarWidth>5</boxcarWidth><scansToAverage>15</scansToAverage><correctForNonLinearity>true</correctForNonLinearity>"
        "<acquisitionTime><milliTime>1458134311936</milliTime></acquisitionTime>"
        "<spectrometerSerialNumber>TEST1</spectrometerSerialNumber>"
        for v in (DARK, COUNTS)
    )
    xml = (
        f"<p><sourceSpectra><s>{light}<channelWavelengths>{doubles(WAVELENGTH)}</channelWavelengths></s>"
        "</sourceSpectra>"
        '<darkSpectrum reference="../x"/><certificates><darkSpectrum>'
        f"{dark}</darkSpectrum></certificates><userName>Zoë</userName>"
        f"<processedPixels>{doubles(COUNTS / 20)}</processedPixels></p>"
    )
    for old, new in changed.items():
        xml = xml.replace(old, new)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("OOIVersion.txt", "1")
        archive.writestr("ps_0.xml", xml.encode("latin-1"))
    return out.getvalue()


def calibration(header="SATHSL", serial="0251", unit="uW/cm^2/nm/sr", n_pixels=180) -> str:
    """The fields of the real frame; coefficients of the pixels are made up."""
    pixels = "".join(
        f"LT {304.9 + 3.33 * k:.2f} '{unit}' 2 BU 1 OPTIC3\n2000.5 1.5e-5 1.75 2.048\n"
        for k in range(n_pixels)
    )
    return (
        f"# made up\nINSTRUMENT {header} '' 6 AS 0 NONE\nSN {serial} '' 4 AI 0 NONE\n"
        "INTTIME LT 'sec' 2 BU 1 POLYU\n0 1e-3\nSAMPLE DELAY 'sec' 2 BS 1 POLYU\n0 1e-3\n" + pixels
        + "DARK_SAMP LT '' 1 BU 0 COUNT\nDARK_AVE LT '' 2 BU 0 COUNT\nAUX NONE '' 2 BU 0 COUNT\n"
        "SPEC TEMP 'C' 2 BU 0 NONE\nTEMP PCB 'C' 2 BU 1 POLYU\n-50 0.5\n"
        "FRAME COUNTER '' 1 BU 0 COUNT\nTIMER NONE 'sec' 10 AF 0 COUNT\nCHECK SUM '' 1 BU 0 COUNT\n"
        "TERMINATOR NONE '\\x0D\\x0A' 2 BU 0 NONE\n"
    )  # fmt: skip


def written(folder: Path, content: str | bytes, name="a.txt") -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def is_truth(spectrum: Spectrum) -> None:
    assert spectrum.wavelength_nm.tolist() == pytest.approx(WAVELENGTH.tolist(), abs=1e-9)
    assert spectrum.raw.tolist() == pytest.approx(COUNTS.tolist(), abs=1e-9)
