"""Names of a package: each says in another file what it is, and none stands in two modules. `python -m tests.names`."""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

PROTOCOL: dict[str, str] = {}
"""Name that may stand in several modules -> why: each of them is one member of a family that is called by this name."""
MOST_PROTOCOLS = 20
MOST_SHARED_CONSTANTS = 157
"""Constants that stand in two modules of `shipid`: this number may only fall."""
DIALECT = frozenset(
    "told found said felt lapse lapses borne stands stood sailed judged asked shown listed spoken deepest beside "
    "meant seen wanted her she he".split()
)
"""Words of this house that no field has; none may be a part of a name."""
ADVERBS = frozenset("here there apart beside aside anew again too once together only otherwise elsewhere".split())
"""Words that may not end a name: the name needs a noun."""
PARTICIPLES = frozenset(
    "begun bound brought built caught chosen done drawn driven fed given gone grown held hidden kept known laid led "
    "left lost made met paid risen sent sought sunk taken thought thrown torn understood written".split()
)
"""Irregular ones; others end in `ed` or `ing`."""
ADJECTIVES = frozenset("even finite free legible late plain short similar visible whole wide wrong".split())
NOUNS = frozenset(
    "bearing damping feed heading mapping need rating reading recording ring sampling scaling seed setting speed "
    "spacing spring steering string timing training tracking warning".split()
)
"""Words that end as participles do, and are nouns."""


def word_fault(name: str) -> str:
    """Return what is wrong with the words of a function or class name; empty for a good one."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower().strip("_").split("_")
    if dialect := next((word for word in words if word in DIALECT), None):
        return f"{dialect!r} is dialect"
    if words[-1] in ADVERBS:
        return f"{words[-1]!r} is an adverb: end with a noun"
    if len(words) == 1:
        (word,) = words
        if word in PARTICIPLES or (re.fullmatch(r"[a-z]{3,}(ed|ing)", word) and word not in NOUNS):
            return "is a participle alone: say of what"
        if word in ADJECTIVES:
            return "is an adjective alone: say of what"
    return ""


Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def definitions(root: Path) -> Iterator[tuple[str, str]]:
    """Name, and place as `file:line`, of every function, class and constant at the top of a module under the root."""
    for file in sorted(root.rglob("*.py")):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            for name in [node.name] if isinstance(node, Definition) else constants(node):
                if not name.startswith("__"):
                    yield name, f"{file.relative_to(root.parent)}:{node.lineno}"


def constants(statement: ast.stmt) -> list[str]:
    """Names in upper case that a statement assigns."""
    given = statement.targets if isinstance(statement, ast.Assign) else []
    given = [statement.target] if isinstance(statement, ast.AnnAssign) else given
    names = (node.id for target in given for node in ast.walk(target) if isinstance(node, ast.Name))
    return [name for name in names if name.isupper()]


def name_faults(root: Path, most_shared: int = 0) -> list[str]:
    """Return a line for every name under the root that stands in two modules or has a wrong word.

    most_shared : how many constants may stand in two modules; where there are more, each is a fault.
    """
    places: dict[str, list[str]] = defaultdict(list)
    for name, place in definitions(root):
        places[name].append(place)
    faults, shared = [], []
    for name, where in places.items():
        files = dict.fromkeys(place.partition(":")[0] for place in where)
        if len(files) > 1 and name not in PROTOCOL:
            line = f"{where[0]}: {name} stands in {len(files)} modules, too in {', '.join(where[1:])}"
            (shared if name.isupper() else faults).append(line)
        if not name.isupper() and (fault := word_fault(name)):
            faults.append(f"{where[0]}: {name}: {fault}")
    return faults + (shared if len(shared) > most_shared else [])


def main() -> int:
    """Print the faults of a package, by default `shipid`; return 1 where there are any."""
    faults = name_faults(Path(*sys.argv[1:2] or ["shipid"]), MOST_SHARED_CONSTANTS)
    sys.stdout.writelines(f"{fault}\n" for fault in faults)
    return int(bool(faults))


if __name__ == "__main__":
    sys.exit(main())
