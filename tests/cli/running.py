"""Run commands in this process, or as a user would."""

from __future__ import annotations

import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from unittest.mock import patch

import pytest
from typer.testing import CliRunner

from shipid.cli import app, main

BAD = Path(__file__).parents[1] / "bad"


def output_of(*arguments: object) -> str:
    """Output of a command that must succeed."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def ended(*arguments: object) -> tuple[object, str, str]:
    """Exit status, output and error of a command in this process, as its entry point runs it."""
    out, err = StringIO(), StringIO()
    typed = patch.object(sys, "argv", ["shipid", *map(str, arguments)])
    with typed, redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as end:
        main()
    return end.value.code, out.getvalue(), err.getvalue()


def shell(*arguments: object, code: str = "from shipid.cli import main; main()") -> subprocess.CompletedProcess[str]:
    """Run the command as a user would, in a new process."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
