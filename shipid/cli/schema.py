"""`shipid schema`: JSON Schemas of documents, for editors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from shipid.errors import ShipidError


def schema_command(
    name: Annotated[Literal["vessel", "study", "mapping", "settings"], typer.Argument(help="kind of document")],
    out: Annotated[Path | None, typer.Option(help="JSON file to write; default: standard output")] = None,
) -> None:
    """Print the JSON Schema of a kind of document, by which an editor completes, explains and checks it."""
    from shipid import schemas
    from shipid.files import json_text, write_json

    if out is None:
        typer.echo(json_text(schemas.document_schema(name)))
    elif out.suffix != ".json":
        raise ShipidError("a schema is a JSON file: let the name end in .json", file=out)
    else:
        write_json(out, schemas.document_schema(name))
        typer.echo(f"schema -> {out}")
