"""Files of spectrometers that are dropped into the explorer, with an index."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from dropped import dropped_file

from lightfield.errors import LightfieldError
from lightfield.explorer.session import Session


def test_an_index_reads_what_was_dropped_with_it_and_nothing_else(session: Session, tmp_path: Path) -> None:
    secret = tmp_path / "secret.txt"
    secret.write_text("1 2 3", encoding="utf-8")
    spectrum = dropped_file("a.txt", "no spectrum")
    for name in (str(secret), f"../{tmp_path.name}/secret.txt", "b.txt"):
        index = dropped_file("index.csv", f"file,z_m\na.txt,4.5\n{name},5.5\n")
        with pytest.raises(LightfieldError, match="were not dropped"):
            session.drop([index, spectrum], "counts")


def spectra(names: Sequence[str], level: float) -> dict[str, bytes]:
    """Files of SpectraSuite, in its own encoding: counts in 0.1 s, at one level over all wavelengths."""
    at = np.arange(500.0, 560.0, 1.0)
    head = "SpectraSuite Data File\nSpectrometers: Müller\nIntegration Time (usec): 100000 (X)\n"
    files = {}
    for k, name in enumerate(names):
        rows = "".join(f"{w:.2f}\t{level / (k + 1):.3f}\n" for w in at)
        text = f"{head}>>>>>Begin Processed Spectral Data<<<<<\n{rows}>>>>>End Processed Spectral Data<<<<<\n"
        files[name] = text.encode("latin-1")
    return files


def test_spectrometer_files_become_the_readings_that_are_explored(given) -> None:
    """An index and nine files, of 8000/1, /2, ... counts per second less a dark of 200."""
    session = Session(given[1].with_values({"detector.bands_nm": ((510.0, 550.0),)}), diffuse=None)
    session.begin()
    names = [f"m{k}.txt" for k in range(9)]
    files = spectra(names, 820.0) | spectra(["dark.txt"], 20.0)
    places = [(x, z) for z in (4.5, 5.5, 6.5) for x in (-0.2, 0.0, 0.2)]
    rows = "".join(f"{name},{x},{z},signal\n" for name, (x, z) in zip(names, places, strict=True))
    files["index.csv"] = f"file,x_m,z_m,role\n{rows}dark.txt,,,dark\n".encode()
    session.drop([dropped_file(name, content) for name, content in files.items()], "counts")
    e = session.experiment
    assert e.has_data and session.readings is not None
    assert e.readings.value == pytest.approx([(820 / (k + 1) - 20) / 0.1 for k in range(9)], rel=1e-4)
    assert e.readings.units == "counts/s" and np.isfinite(session.evaluation().numbers["error_percent"])


def test_a_spectrometer_file_that_is_no_text_is_read_as_it_is(given) -> None:
    """A ProcSpec file is an archive: bytes must survive the way from the page."""
    from instrument_files import procspec

    session = Session(given[1].with_values({"detector.bands_nm": ((405.0, 425.0),)}), diffuse=None)
    session.begin()
    index = "file,z_m\n" + "".join(f"s{k}.procspec,{4.5 + k}\n" for k in range(6))
    files = {f"s{k}.procspec": procspec() for k in range(6)} | {"index.csv": index.encode()}
    session.drop([dropped_file(name, content) for name, content in files.items()], "counts")
    assert len(session.experiment.readings) == 6
