"""Documents of families: a vessel and `[[family]]` blocks, without a study; a lock is one with what was drawn."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from shipid import document as documents
from shipid.checked import CheckedModel
from shipid.document import Document
from shipid.errors import DocumentError, suggest_name
from shipid.vessel.perturb import Family, resolve_families


class FamilyDocument(CheckedModel, BaseModel):
    """A document of families."""

    model_config = ConfigDict(extra="forbid")
    description: str | None = None
    vessel: str | None = Field(default=None, description="base of the families that name none and extend none")
    family: Annotated[list[Family], Field(min_length=1)]
    lock: dict[str, Any] | None = Field(default=None, description="what was drawn, as `shipid family export` writes it")


def read_family_document(name: str | Path, relative_to: Path | None = None) -> tuple[Path, Document]:
    """File and content of a document of families, of a lock, or of a study, of which the families alone are taken.

    Families that name no base and extend none have that of the document. DocumentError for what is not valid.
    """
    file = documents.find_document(name, "studies", relative_to)
    document = documents.read_document(file)
    if "prediction" in document and "family" in document:  # a study
        document = expand_families(document, file)
        document = {key: document[key] for key in ("description", "family") if key in document}
    content: FamilyDocument = documents.parse_model(FamilyDocument, document, file)
    bare = ("base", "extends")
    blocks = [
        {"base": content.vessel, **block} if content.vessel and not any(map(block.get, bare)) else block
        for block in document["family"]
    ]
    return file, {**document, "family": blocks}


def expand_families(document: Document, file: Path) -> Document:
    """A study document with the families of the document that it names as `families` before its own.

    A base by path is a path from the study's folder, or from the working folder, then.
    """
    if not isinstance(document.get("families"), str):
        return document
    named = document["families"]
    try:
        theirs, content = read_family_document(named, file.parent)
    except DocumentError as error:
        raise DocumentError(str(error), file=file, path="families") from None
    folder = Path(named).parent
    blocks = [
        {**block, "base": (folder / base).as_posix()}
        if (base := block.get("base", "")).endswith(".toml") and (theirs.parent / base).is_file()
        else block
        for block in content["family"]
    ]
    return {key: value for key, value in document.items() if key != "families"} | {
        "family": [*blocks, *document.get("family", [])]
    }


def choose_family(file: Path, document: Mapping[str, Any], name: str | None = None) -> Family:
    """The family of a document with a name, written out; the name may be left out where there is one only."""
    families = resolve_families([Family.model_validate(block) for block in document["family"]], file)
    names = [family.name for family in families]
    if name is None and len(names) > 1:
        raise DocumentError(f"has {len(names)} families: choose one of {', '.join(names)}", file=file, path="family")
    if name not in (None, *names):
        raise DocumentError(f"no family {name!r}: {suggest_name(str(name), names)}", file=file, path="family")
    return families[0 if name is None else names.index(name)]
