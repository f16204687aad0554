"""What a wheel says of itself: nothing that only a copy of the repository has, authors as in CITATION.cff."""

from __future__ import annotations

import email
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import shipid
from shipid import version

ROOT = Path(__file__).parents[1]


def test_a_wheel_has_no_link_into_the_repository(tmp_path: Path) -> None:
    pytest.importorskip("hatchling", reason="comes with the extra `dev`")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        metadata = email.message_from_bytes(archive.read(name))
        files = archive.namelist()
    readme = metadata.get_payload(decode=True).decode()
    assert "## A study of your ship" in readme
    links = re.findall(r"\]\(([^)]*)\)", readme)
    assert links
    assert all(link.startswith("https://") for link in links)
    (author,) = re.findall(r'^  - name: "(.*)"$', (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    assert metadata["Author"] == author
    assert {"dask", "docs", "export", "forest"} <= set(metadata.get_all("Provides-Extra"))
    assert {"shipid/_bundled/studies/quick.toml", "shipid/_bundled/models/mariner.toml"} <= set(files)
    assert not [file for file in files if file.startswith(("tests/", "docs/"))]


def test_the_version_is_the_one_of_the_file() -> None:
    assert shipid.__version__ == version.__version__
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.dev\d+|rc\d+)?", version.__version__)


def test_the_file_imports_nothing() -> None:
    assert "import" not in Path(version.__file__).read_text(encoding="utf-8").split('"""')[2]
