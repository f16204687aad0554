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
    rows = [[path, *map(_value_in_words, values)] for path, values in _differing_values(whole, "")]
    return pd.DataFrame(rows, columns=["path", *map(str, range(len(plans)))])


def _differing_values(values: Sequence[Any], path: str) -> Iterator[tuple[str, Sequence[Any]]]:
    """Dotted path and values where they are not all equal, as deep as all of them have tables."""
    if all(isinstance(value, list) and value and isinstance(value[0], Mapping) for value in values):
        values = [{str(place): entry for place, entry in enumerate(value)} for value in values]
    if all(isinstance(value, Mapping) for value in values):
        for key in dict.fromkeys(key for value in values for key in value):
            yield from _differing_values([value.get(key) for value in values], f"{path}.{key}".removeprefix("."))
    elif any(value != values[0] for value in values):
        yield path, values


def _value_in_words(value: Any) -> str:
    return ABSENT if value is None else value if isinstance(value, str) else json.dumps(value)
