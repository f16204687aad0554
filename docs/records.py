"""Records of measurements, and the numbers that pages quote from them.

`python docs/records.py NAME COMMAND ...` runs a command and writes what it prints to `docs/records/NAME.md`, below the
command, the date, the version and the machine. A paragraph, list or table of a page that links to a record quotes from
it: every number in it must be in one of the records that it links to, else `make docs` fails.
"""

from __future__ import annotations

import datetime
import os
import platform
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

RECORDS = Path(__file__).parent / "records"
HEAD = ("command", "date", "version", "machine")
"""What the list at the top of a record says, in this order."""
LINK = re.compile(r"\]\((?:docs/)?records/([\w-]+)\.md[^)]*\)")
NUMBER = re.compile(r"(?<![\w.,])\d+(?:,\d{3})*(?:\.\d+)?(?![\w]*\d)")
UNQUOTED = re.compile(r"`[^`]*`|\]\([^)]*\)|\bN_D\b|\b\d+/\d+\b")
"""What no measurement is: code, the target of a link, the name of a zigzag."""


def numbers_of(text: str) -> set[str]:
    """Numbers of a text as they are written, without code and targets of links; `1,000` counts as `1000`."""
    return {number.replace(",", "") for number in NUMBER.findall(UNQUOTED.sub(" ", text))}


def blocks_of(page: str) -> Iterator[str]:
    """Paragraphs, lists and tables of a page, without its blocks of code."""
    text = re.sub(r"^(`{3,}|:{3,}).*?^\1 *$", "", page, flags=re.MULTILINE | re.DOTALL)
    yield from (block for block in re.split(r"\n\s*\n", text) if block.strip())


def unsupported(page: str, records: Path = RECORDS) -> list[str]:
    """Return a line for each number that a page quotes and that is in none of the records of its block."""
    faults = []
    for block in blocks_of(page):
        names = LINK.findall(block)
        if not names:
            continue
        missing = [name for name in names if not (records / f"{name}.md").is_file()]
        faults += [f"there is no record {name}" for name in missing]
        held = "\n".join((records / f"{name}.md").read_text(encoding="utf-8") for name in names if name not in missing)
        known = {number.replace(",", "") for number in NUMBER.findall(held)}
        for number in sorted(numbers_of(block) - known):
            faults.append(f"{number} is not in the record {', '.join(names)}: {' '.join(block.split())[:60]} ...")
    return faults


def machine() -> str:
    """Return the processor, its widest vectors, the cores that this process may use, and the version of Python."""
    cpu = Path("/proc/cpuinfo")
    text = cpu.read_text(encoding="utf-8") if cpu.is_file() else ""
    name = re.search(r"^model name\s*: (.*)$", text, re.MULTILINE)
    vectors = next((word for word in ("avx512f", "avx2") if word in text), "")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    words = [name[1] if name else platform.machine(), vectors, f"{cores} cores", f"Python {platform.python_version()}"]
    return ", ".join(filter(None, words))


def record_text(name: str, command: str, output: str) -> str:
    """Return the page of a record: its head, then what the command printed."""
    from shipid import __version__

    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    version = f"{__version__}, commit {commit.stdout.strip() or 'unknown'}"
    values = (f"`{command}`", datetime.date.today().isoformat(), version, machine())
    head = [f"- {key}: {value}" for key, value in zip(HEAD, values, strict=True)]
    return "\n".join([f"# Record: {name}", "", *head, "", "```text", output.rstrip(), "```", ""])


def main(name: str, *command: str) -> int:
    """Run a command and write its record; nothing is written where the command fails."""
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode == 0:
        text = record_text(name, shlex.join(command), done.stdout)
        (RECORDS / f"{name}.md").write_text(text, encoding="utf-8")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
