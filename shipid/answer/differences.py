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

    Compared are the studies with their defaults, the vessels that all have by one name, and the digests of data.

    Parameters
    ----------
    sessions : for each plan, what its run was computed with; compared, too.
    called : for each plan, method or family -> the name that it is compared under.
    """
    shared = set.intersection(*({*plan.vessels} for plan in plans))
    whole = [
        {
            **whole_document(plan, names),
            "digest of": dict(plan.sources),
            "vessel": {name: {"digest": plan.vessels[name].digest, **plan.vessels[name].document} for name in shared},
            "computed with": dict(session),
        }
        for plan, session, names in zip(plans, sessions or [{}] * len(plans), called or [{}] * len(plans), strict=True)
    ]
    flat = [dict(_leaves(document, "")) for document in whole]
    paths = dict.fromkeys(path for one in flat for path in one)
    rows = [[path, *(one.get(path, ABSENT) for one in flat)] for path in paths]
    return pd.DataFrame([row for row in rows if len(set(row[1:])) > 1], columns=["path", *map(str, range(len(plans)))])


def _leaves(value: Any, path: str) -> Iterator[tuple[str, str]]:
    """Dotted path and text of every value that is no table and no list of tables."""
    if isinstance(value, list) and value and all(isinstance(entry, Mapping) for entry in value):
        value = {str(place): entry for place, entry in enumerate(value)}
    if isinstance(value, Mapping):
        for key, inside in value.items():
            yield from _leaves(inside, f"{path}.{key}" if path else str(key))
    elif value is not None:
        yield path, value if isinstance(value, str) else json.dumps(value)
