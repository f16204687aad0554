"""Public sets: the log behind a bundled mapping, from the data folder or from where it is published."""

from __future__ import annotations

import os
from pathlib import Path

from shipid.errors import DataError
from shipid.logs.importing import log_digest
from shipid.logs.mapping import read_mapping

FOLDER_VARIABLE = "SHIPID_DATA"


def fetch_log(name: str) -> Path:
    """The file of the log of a mapping, its checksum verified: in SHIPID_DATA if that is set, else downloaded once.

    Raises DataError if it is not there, cannot be downloaded, or is another file.
    """
    mapping = read_mapping(name)
    source = mapping.source
    folder = os.environ.get(FOLDER_VARIABLE)
    if folder:
        if source.file is None:
            raise DataError("the mapping names no file in a data folder", file=name, path="source.file")
        file = Path(folder) / source.file
        if not (file.is_file() if source.runs is None else file.is_dir()):
            raise DataError(
                f"not there: put the log there, or unset {FOLDER_VARIABLE} to download it ({source.url})", file=file
            )
        if source.sha256 not in (None, log_digest(mapping, file)):
            raise DataError(
                f"not the published file (sha256 differs from that of {name!r}): fetch it anew from {source.url}",
                file=file,
                path="source.sha256",
            )
        return file
    if source.url is None or source.sha256 is None or source.runs is not None:
        raise DataError(
            f"not downloaded: give the log itself, or set {FOLDER_VARIABLE} to a folder that holds it"
            f"{f' ({source.url})' * bool(source.url)}",
            file=name,
            path="source.url",
        )
    return _download_log(name, source.url, source.sha256, source.file)


def _download_log(name: str, url: str, sha256: str, file: str | None) -> Path:
    import pooch  # takes 60 ms, which commands without a download need not wait for

    stem = Path(name).stem  # the name may be the path of a mapping; the file must still lie in the cache folder
    cache = Path(pooch.os_cache("shipid"))
    pooch.get_logger().setLevel("WARNING")
    try:
        return Path(pooch.retrieve(url, f"sha256:{sha256}", fname=f"{stem}-{url.rpartition('/')[2]}", path=cache))
    except ValueError:  # pooch's word for a wrong checksum; it has already removed the download
        raise DataError(
            f"what came is not the published file (sha256 differs): try again, or set {FOLDER_VARIABLE}",
            file=url,
            path="source.sha256",
        ) from None
    except OSError as error:  # requests' errors are OSErrors too, without a number
        if error.errno or isinstance(error, PermissionError):
            raise DataError(
                f"no log can be kept there ({error.strerror or 'Permission denied'}): set XDG_CACHE_HOME to a folder "
                f"that can, or {FOLDER_VARIABLE} to one with the log",
                file=cache,
            ) from None
        raise DataError(
            f"cannot be downloaded ({type(error).__name__}): go online, or set {FOLDER_VARIABLE} to a folder "
            f"that holds {file or 'the log'}",
            file=url,
        ) from None
