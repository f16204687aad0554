"""The completion of the shell: what bash would offer, from the script that it is given."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from shipid.cli.completion import offer_documents, offer_files
from shipid.document import bundled_documents


def offered(folder: Path, *words: str) -> list[str]:
    """Completions of the last word, by the protocol of the script for bash, without a shell."""
    code = "from shipid.cli import app; app(prog_name='shipid')"
    environment = {**os.environ, "COMP_WORDS": " ".join(["shipid", *words]), "COMP_CWORD": str(len(words))}
    result = subprocess.run(
        [sys.executable, "-c", code],
        env={**environment, "_SHIPID_COMPLETE": "complete_bash"},
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.stderr == ""
    return result.stdout.split()


def test_names_commands_and_cells(tmp_path: Path) -> None:
    (tmp_path / "run" / "cells").mkdir(parents=True)
    (tmp_path / "run" / "cells" / "none+drawn-N0004-s0.npz").touch()
    assert offered(tmp_path, "study", "run", "qu") == ["quick"]
    assert offered(tmp_path, "schema", "ma") == ["mapping"]
    assert offered(tmp_path, "study", "com") == ["compare"]
    assert offered(tmp_path, "predict", "run", "log.parquet", "--cell", "no") == ["none+drawn-N0004-s0"]


def test_names_before_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("mine.toml", "notes.txt", ".hidden.toml"):
        Path(name).touch()
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "x.toml").touch()
    assert offer_documents("models")("m") == ["mariner", "mine.toml", "models/"]
    assert offer_documents("models")("") == [*bundled_documents("models"), "mine.toml", "models/"]
    assert offer_documents("models")("models/") == ["models/x.toml"]
    assert offer_documents("models")("gone/x") == []
    assert offer_files(".txt")("n") == ["notes.txt"]
    assert offer_files()("") == ["models/"]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_bash_itself(tmp_path: Path) -> None:
    """The script that `--show-completion` prints completes in bash."""
    program = tmp_path / "bin" / "shipid"
    program.parent.mkdir()
    program.write_text(f"#!{sys.executable}\nfrom shipid.cli import main\nmain()\n")
    program.chmod(0o755)
    script = (
        "source <(_SHIPID_COMPLETE=source_bash shipid); COMP_WORDS=(shipid vessel show kvlcc2-h); COMP_CWORD=3; "
        '_shipid_completion shipid; echo "${COMPREPLY[@]}"; complete -p shipid'
    )
    environment = {**os.environ, "PATH": f"{program.parent}:{os.environ['PATH']}"}
    result = subprocess.run(
        ["bash", "--norc", "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    assert result.stdout.splitlines()[0] == "kvlcc2-hsva", result
    assert "-o default" in result.stdout, "files are left to the shell where nothing is offered"
