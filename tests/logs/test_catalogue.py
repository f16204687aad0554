"""Public sets: from the data folder with their checksum, or one line that says what to do. Nothing is downloaded."""

import errno
from pathlib import Path

import pooch
import pytest
import requests

from shipid.document import bundled_documents
from shipid.errors import DataError, DocumentError
from shipid.logs.catalogue import fetch_log
from shipid.logs.importing import read_mapping

NAME = "gunnerus-2022"


def test_from_the_shared_data(shared_data: Path, gunnerus_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SHIPID_DATA", str(shared_data))
    assert fetch_log(NAME) == gunnerus_log


def test_every_bundled_mapping_names_its_bytes() -> None:
    bundled = bundled_documents("studies/mappings")
    assert NAME in bundled
    for name in bundled:
        source = read_mapping(name).source
        assert None not in (source.url, source.sha256, source.file, source.citation, source.licence)


def test_a_log_without_an_address_is_to_be_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It ended with `(None)`."""
    monkeypatch.delenv("SHIPID_DATA", raising=False)
    mapping = tmp_path / "mapping.toml"
    mapping.write_text((Path(__file__).parents[1] / "bad" / "logs" / "plain.toml").read_text())
    with pytest.raises(DataError, match=r"to a folder that holds it$"):
        fetch_log(str(mapping))


def test_absent_and_changed_logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SHIPID_DATA", str(tmp_path))
    with pytest.raises(DataError, match="unset SHIPID_DATA to download"):
        fetch_log(NAME)
    file = tmp_path / str(read_mapping(NAME).source.file)
    file.parent.mkdir()
    file.write_text("tvec\n")
    with pytest.raises(DataError, match="sha256 differs") as caught:
        fetch_log(NAME)
    assert caught.value.file == str(file)


@pytest.mark.parametrize(
    ("failure", "remedy"),
    [
        (requests.ConnectionError("no route"), "go online"),
        (requests.HTTPError("404"), "set SHIPID_DATA"),
        (PermissionError("Pooch could not create data cache folder"), "set XDG_CACHE_HOME to a folder that can"),
        (OSError(errno.ENOSPC, "No space left on device"), r"\(No space left on device\): set XDG_CACHE_HOME"),
        (ValueError("SHA256 hash of downloaded file does not match"), "is not the published file"),
    ],
)
def test_failed_downloads(failure: Exception, remedy: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise failure

    monkeypatch.delenv("SHIPID_DATA", raising=False)
    monkeypatch.setattr(pooch, "retrieve", refuse)
    with pytest.raises(DataError, match=remedy):
        fetch_log(NAME)


def test_download_keeps_the_checksum(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another file behind the url is refused by pooch itself: it is served here from the disk."""
    monkeypatch.delenv("SHIPID_DATA", raising=False)
    monkeypatch.setattr(pooch, "os_cache", lambda _: tmp_path)

    class FromDisk:
        def __call__(self, _url: str, output_file: str, _pooch: object, **__: object) -> None:
            Path(output_file).write_text("tvec\n")

    monkeypatch.setattr(pooch.core, "choose_downloader", lambda *_, **__: FromDisk())
    with pytest.raises(DataError, match="is not the published file"):
        fetch_log(NAME)
    assert list(tmp_path.iterdir()) == []


def test_unknown_name() -> None:
    with pytest.raises(DocumentError, match="did you mean 'gunnerus-2022'"):
        fetch_log("gunnerus-2021")
