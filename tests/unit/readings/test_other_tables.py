"""Other tables than of readings, and words in capitals."""

from __future__ import annotations

import pytest

from lightfield.errors import MeasurementError
from lightfield.readings import read_table
from lightfield.readings.importing.importer import import_index


@pytest.mark.parametrize(
    "content", ["file,z_m,role\na.txt,2,signal\nd.txt,,dark\n", "Maker;Mini\nNumber;7\n400,0;12,5\n"]
)
def test_what_has_to_be_imported_is_sent_there_in_one_line(tmp_path, content):
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(MeasurementError, match="import it: make a reading table of it") as caught:
        read_table(tmp_path / "a.csv")
    assert len(str(caught.value).splitlines()) == 1


def test_words_may_have_capitals(tmp_path):
    (tmp_path / "a.csv").write_text("z_m,value,medium,role\n1,2,Water,Signal\n1,3,AIR,signal\n")
    found = read_table(tmp_path / "a.csv")
    assert found.medium.tolist() == ["water", "air"] and found.role.tolist() == ["signal"] * 2
    (tmp_path / "b.csv").write_text("z_m,Ed,medium\n1,2,Air\n2,3,Water\n")
    columns = {"z_m": "z_m", "value": "Ed", "medium": "medium"}
    asked = {"quantity": "irradiance", "units": "relative", "bands_nm": [(500.0, 550.0)]}
    again = import_index(tmp_path / "b.csv", **asked, columns=columns)
    assert again.medium.tolist() == ["air", "water"]
