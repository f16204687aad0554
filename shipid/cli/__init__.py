"""The command line: it turns arguments into calls, and events into lines. Heavy imports wait for their command."""

from __future__ import annotations

import errno
import re
import sys
from collections.abc import Callable, Collection
from copy import copy
from inspect import getdoc
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.models import CommandInfo

import shipid
from shipid.cli import data, expect, family, identify, predict, simulation, study, vessel
from shipid.cli.answer import log_to_stderr
from shipid.cli.options import GuardedCommand
from shipid.errors import RETIRED, ShipidError, is_utf_8
from shipid.plugins import import_files

OPTIONS: dict[str, Any] = {
    "no_args_is_help": True,
    "add_completion": False,
    "pretty_exceptions_enable": False,
    "rich_markup_mode": None,  # half of the time of `shipid --help` went into its frames
    "context_settings": {"max_content_width": 120},
    "help": "How good must the physics be, and how much data is needed, to predict a ship's trajectory?",
}
COMMANDS: dict[str, Callable[..., Any]] = {
    "simulate": simulation.simulate_command,
    "manoeuvre": simulation.manoeuvre_command,
    "replay": simulation.replay_command,
    "identify": identify.identify_command,
    "expect": expect.expect_command,
    "predict": predict.predict_command,
    "export": predict.export_command,
    "aboard": predict.aboard_command,
}
NAMELESS = {  # errors of the system that name no file -> what helps
    errno.EAGAIN: "this user has too many processes and threads: end some, raise `ulimit -u`, or take fewer --workers",
    errno.EMFILE: "raise `ulimit -n`",
    errno.ENOENT: "change to a working folder that is there, and set TMPDIR to a folder that can be written",
}
GROUPS = {"vessel": vessel.app, "family": family.app, "data": data.app, "study": study.app}


def main() -> None:
    """Run the command line: an error that the user can correct is one line, never a traceback."""
    try:
        for argument in sys.argv[1:]:  # documents, pages and tables could not name such a file
            if not is_utf_8(argument):
                raise ShipidError("is not UTF-8: rename the file or folder, or set LC_ALL=C.UTF-8", path=argument)
        sys.argv[1:] = _move_to_front(sys.argv[1:])
        narrow_commands(app, sys.argv[1:])()
    except BrokenPipeError:
        sys.exit(141)
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)
    except SystemExit as end:
        if isinstance(getattr(end.__context__, "__cause__", None), KeyboardInterrupt):  # Typer ends without a word
            sys.stderr.write("interrupted\n")
        raise
    except Exception as error:
        line = error_line(error)
        if line is None:
            raise
        sys.stderr.write(f"error: {line}\n")
        sys.exit(1)


def narrow_commands(every: typer.Typer, words: Collection[str]) -> typer.Typer:
    """The same commands; of those that no word names only name and help: their parameters took half of the start."""
    narrow = copy(every)
    narrow.registered_commands = [
        one if one.name in words else CommandInfo(one.name, help=getdoc(one.callback), callback=lambda: None)
        for one in every.registered_commands
    ]
    narrow.registered_groups = [copy(one) for one in every.registered_groups]
    for one in narrow.registered_groups:
        one.typer_instance = narrow_commands(one.typer_instance or every, words)
    return narrow


def _move_to_front(words: list[str]) -> list[str]:
    """Move every `--with FILE` and `--with=FILE` before the command: it may stand behind it."""
    pairs = zip(["", *words], words, strict=False)
    return [word for _, word in sorted(pairs, key=lambda pair: not ("--with" in pair or pair[1].startswith("--with=")))]


def print_usage_error(error: Any, _: Any = None) -> None:
    """Print a wrong argument in one line, as `main` prints other errors; that of Typer is four."""
    fault, command = (
        " ".join(error.format_message().replace("Value error, ", "").split()),
        error.ctx.command_path if error.ctx else "shipid",
    )
    typed = re.match(r"No such (?:command '|option: )([\w-]+)", fault)
    remedy = RETIRED.get(typed[1] if typed else "", f"`{command} --help` shows what is right")
    sys.stderr.write(f"error: {fault.rstrip('.')}: {remedy}\n")


usage_error: Any = typer.BadParameter.__base__  # Typer, which has its own Click, does not export it
usage_error.show = print_usage_error


def error_line(error: Exception) -> str | None:
    """What went wrong and what helps, for an error that the user can correct; None for a fault of shipid."""
    if isinstance(error, ShipidError):
        return str(error)
    if isinstance(error, MemoryError):
        return "out of memory: longer steps, fewer runs, members or --workers take less"
    if isinstance(error, ImportError) and str(error.path).endswith((".so", ".pyd")):  # memory is short, or foreign code
        return f"{error.path}: cannot be loaded ({error.msg}): raise `ulimit -v`, or install it anew"
    if isinstance(error, RuntimeError) and "start new thread" in str(error):
        return f"system: {error}: {NAMELESS[errno.EAGAIN]}"
    if isinstance(error, OSError):  # a full disk, a folder that is a file, a place where one may not write
        words = error.strerror or str(error)
        remedy = NAMELESS.get(error.errno or 0) if not error.filename else None
        return f"{error.filename or 'system'}: {words}" + (f": {remedy}" if remedy else "")
    return None


def _configure_output(
    version: Annotated[bool, typer.Option("--version", help="show the version")] = False,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="log what is done to standard error")] = False,
    tried: Annotated[
        list[Path] | None,
        typer.Option(
            "--with", help="file of Python with terms, methods or readers of yours: it is run, here and in workers"
        ),
    ] = None,
) -> None:
    log_to_stderr(verbose)
    import_files(tried or [])
    if version:
        typer.echo(shipid.__version__)
        raise typer.Exit


app = typer.Typer(**OPTIONS)
app.callback(invoke_without_command=True)(_configure_output)
for name, command in COMMANDS.items():
    app.command(name)(command)
for group in (app, *GROUPS.values()):
    for registered in group.registered_commands:
        registered.cls = GuardedCommand
for name, group in GROUPS.items():
    app.add_typer(group, name=name)
