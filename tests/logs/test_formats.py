"""Keys of [format]: those that a kind has, and what is wrong."""

from pathlib import Path

import pytest

from shipid.errors import DocumentError
from shipid.logs.importing import read_mapping
from tests.logs.conftest import mapping_with


@pytest.mark.parametrize(
    ("form", "path", "remedy"),
    [
        ('kind = "nmae"', "format.kind", "did you mean 'nmea'"),
        ('kind = "parquet"\nseparator = ";"', "format.separator", "unknown key: valid: kind"),
        ('kind = "nmea"\ntime = "utc"', "format.time", "'fix' or 'line'"),
    ],
)
def test_keys_of_a_format(form: str, path: str, remedy: str, tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=remedy) as caught:
        read_mapping(mapping_with(tmp_path, form))
    assert caught.value.path == path
