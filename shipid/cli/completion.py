"""What the shell offers when TAB is pressed: bundled names, names in a folder, and files."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import typer

Offer = Callable[[str], list[str]]


def offer_documents(kind: str) -> Offer:
    """Offer the bundled documents of a kind (`models`, `studies`, `studies/mappings`), then TOML files."""

    def offer(incomplete: str) -> list[str]:
        from shipid.document import bundled_documents

        return [*names_beginning_with(incomplete, bundled_documents(kind)), *offer_files(".toml")(incomplete)]

    return offer


def offer_files(*endings: str) -> Offer:
    """Offer folders, and files of these endings."""

    def offer(incomplete: str) -> list[str]:
        head, slash, start = incomplete.rpartition("/")
        try:
            entries = sorted(Path(head + slash or ".").iterdir())
        except OSError:
            return []
        named = ((head + slash + path.name, path) for path in entries if start or not path.name.startswith("."))
        return [
            name + "/" * path.is_dir()
            for name, path in named
            if name.startswith(incomplete) and (path.is_dir() or path.suffix in endings)
        ]

    return offer


def offer_cells(context: typer.Context, incomplete: str) -> list[str]:
    """Offer the cells of the folder that the command names."""
    folder = context.params.get("folder") or next(iter(context.args), None)  # not parsed while the line is not whole
    return (
        names_beginning_with(incomplete, sorted(file.stem for file in Path(folder, "cells").glob("*.npz")))
        if folder
        else []
    )


def names_beginning_with(incomplete: str, names: Iterable[str]) -> list[str]:
    """Return the names that begin so."""
    return [name for name in names if name.startswith(incomplete)]
