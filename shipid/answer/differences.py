"""What differs between the documents of several runs, with every default written out."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pandas as pd

from shipid import document as documents
from shipid.document import Document
from shipid.study.plan import Plan
from shipid.study.schema import Study

ABSENT = "-"  # shown where a document has no such key


def whole_document(plan: Plan, called: Mapping[str, str] | None = None) -> Document:
    """Return the study of a plan with every default; methods, families and conditions go by name, not by place.

    called : method or family -> the name that it goes by here instead.
    """
    study = documents.parse(Study, plan.document, plan.file)
    document: Document = study.model_dump(mode="json")
    for block, way in zip(document["method"], plan.methods, strict=True):
        block |= way.method.model_dump(mode="json")
    for key in ("method", "family", "condition"):
        document[key] = {(called or {}).get(entry["name"], entry["name"]): entry for entry in document[key]}
    return document


def document_differences(
    plans: Sequence[Plan], sessions: Sequence[Mapping[str, Any]] = (), called: Sequence[Mapping[str, str]] = ()
) -> pd.DataFrame:
    """One row per value that is not the same in all plans: `path`, then a column of text for each plan, from 0 on.

    Compared are the studies with their defaults, the vessels that go by one name, and the digests of recorded data.

    Parameters
    ----------
    sessions : for each plan, what its run was computed with; compared, too.
    called : for each plan, method or family -> the name that it is compared under.
    """
    whole = [
        {
            **whole_document(plan, names),
            "digest of": dict(plan.sources),
            "vessel": {name: {"digest": vessel.digest, **vessel.document} for name, vessel in plan.vessels.items()},
            "computed with": dict(session),
        }
        for plan, session, names in zip(plans, sessions or [{}] * len(plans), called or [{}] * len(plans), strict=True)
    ]
    for name in {name for one in whole for name in one["vessel"]}:
        if not all(name in one["vessel"] for one in whole):  # another ship: its families say so
            for one in whole:
                one["vessel"].pop(name, None)
    rows = [[path, *map(_text, values)] for path, values in _different(whole, "")]
    return pd.DataFrame(rows, columns=["path", *map(str, range(len(plans)))])


def _different(values: Sequence[Any], path: str) -> Iterator[tuple[str, Sequence[Any]]]:
    """Dotted path and values where they are not all equal, as deep as all of them have tables."""
    tables = [_table(value) for value in values]
    if not all(table is not None for table in tables):
        if any(value != values[0] for value in values):
            yield path, values
        return
    for key in dict.fromkeys(key for table in tables for key in table or {}):
        inside = f"{path}.{key}" if path else key
        yield from _different([(table or {}).get(key) for table in tables], inside)


def _table(value: Any) -> Mapping[str, Any] | None:
    """The value as a table, if it is one or a list of tables."""
    if isinstance(value, list) and value and all(isinstance(entry, Mapping) for entry in value):
        return {str(place): entry for place, entry in enumerate(value)}
    return value if isinstance(value, Mapping) else None


def _text(value: Any) -> str:
    if value is None:
        return ABSENT
    return value if isinstance(value, str) else json.dumps(value)
