"""The command line: it turns arguments into calls, and events into lines. Heavy imports wait for their command."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from shipid.cli import data, export, identify, predict, replay, schema, simulation, study, vessel
from shipid.cli.terminal import log_to_stderr
from shipid.errors import ShipidError

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="How good must the physics be, and how much data is needed, to predict a ship's trajectory?",
)
app.command("simulate")(simulation.simulate)
app.command("manoeuvre")(simulation.manoeuvre)
app.command("replay")(replay.replay)
app.command("identify")(identify.identify)
app.command("predict")(predict.predict)
app.command("schema")(schema.schema)
app.command("export")(export.export)
app.command("aboard")(export.aboard)
app.add_typer(vessel.app, name="vessel")
app.add_typer(data.app, name="data")
app.add_typer(study.app, name="study")


def main() -> None:
    """Run the command line: an error that the user can correct is one line, never a traceback."""
    try:
        app()
    except ShipidError as error:
        sys.stderr.write(f"error: {error}\n")
        sys.exit(1)
    except BrokenPipeError:
        sys.exit(141)
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)
    except MemoryError:
        sys.stderr.write("error: out of memory: fewer --workers, longer intervals or fewer members take less\n")
        sys.exit(1)
    except OSError as error:  # a full disk, a folder that is a file, a place where one may not write
        sys.stderr.write(f"error: {error.filename or 'system'}: {error.strerror or error}\n")
        sys.exit(1)


@app.callback(invoke_without_command=True)
def _before(
    version: Annotated[bool, typer.Option("--version", help="show the version")] = False,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="log what is done to standard error")] = False,
) -> None:
    log_to_stderr(verbose)
    if version:
        from shipid.version import __version__

        typer.echo(__version__)
        raise typer.Exit
