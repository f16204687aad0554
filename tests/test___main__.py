"""`python -m shipid` is the command `shipid`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from shipid.version import __version__


def python_m(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "shipid", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)


def test_the_package_runs_as_the_command() -> None:
    assert python_m("--version").stdout.strip() == __version__


def test_a_mistake_is_one_line_and_status_1() -> None:
    result = python_m("vessel", "show", "marinre")
    assert result.returncode == 1
    assert result.stderr.startswith("error: ")
    assert "did you mean 'mariner'?" in result.stderr
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize("stage", ["gc.set_threshold", "shipid.cli", "shipid.cli.main"])
def test_ctrl_c_before_the_first_line_of_the_command_ends_quietly(stage: str) -> None:
    code = (
        "import builtins, unittest.mock, shipid.__main__ as m\n"
        "real = builtins.__import__\n"
        "def stop(name, *rest):\n"
        f"    if name == {stage!r}: raise KeyboardInterrupt\n"
        "    return real(name, *rest)\n"
        "builtins.__import__ = stop\n"
        f"if {stage!r} != 'shipid.cli': unittest.mock.patch({stage!r}, side_effect=KeyboardInterrupt).start()\n"
        "m.run_command_line()"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600, check=False)
    assert (result.returncode, result.stderr) == (130, "interrupted\n")


@pytest.mark.parametrize(("encoding", "shown"), [("ascii", "\u8239".encode()), ("latin-1", b"\\u8239")])
def test_signs_that_a_terminal_does_not_know_are_written_out(encoding: str, shown: bytes, tmp_path: Path) -> None:
    """Before, a name in another script ended in a traceback; Click writes UTF-8 where a terminal knows ASCII alone."""
    vessel = tmp_path / "vessel.toml"
    vessel.write_text('base = "gunnerus-28.9"\nname = "\u8239"\n', encoding="utf-8")
    command = [sys.executable, "-m", "shipid", "vessel", "show", str(vessel)]
    environment = os.environ | {"PYTHONIOENCODING": encoding, "FORCE_COLOR": "1", "COLUMNS": "40"}
    result = subprocess.run(command, env=environment, capture_output=True, timeout=600, check=False)
    assert (result.returncode, result.stderr) == (0, b"")
    assert shown in result.stdout
