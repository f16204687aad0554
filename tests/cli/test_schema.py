"""`shipid schema`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import get_args, get_type_hints

from shipid.cli.schema import schema_command as command
from shipid.schemas import SCHEMAS, document_schema
from tests.cli.running import output_of


def test_every_schema_is_printed_or_written(tmp_path: Path) -> None:
    assert json.loads(output_of("schema", "settings")) == document_schema("settings")
    file = tmp_path / "new" / "mapping.schema.json"
    assert output_of("schema", "mapping", "--out", file).strip() == f"schema -> {file}"
    assert json.loads(file.read_text()) == document_schema("mapping")


def test_the_command_knows_every_kind_of_document() -> None:
    named = get_type_hints(command)["name"]
    assert set(get_args(named)) == set(SCHEMAS)
