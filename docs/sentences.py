"""The longest and the oddest sentences of the hand-written pages: `python docs/sentences.py [NUMBER]`.

Odd is a sentence with a word that the field does not use, with "her" or "she" for a ship, or with two semicolons.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LONG = 30
"""Words of a sentence from which on it counts as long."""
ODD = re.compile(
    r"\b(?:told|found|said|felt|lapses?|borne out|bears? (?:that|it) out|stands?|sailed|judged|the same with it|"
    r"what is none|her|hers|she|herself)\b|;.*;",
    re.IGNORECASE,
)


def pages(root: Path = ROOT) -> list[Path]:
    """Return the readme, the changelog and the pages of `docs` that people write."""
    return [root / "README.md", root / "CHANGELOG.md", *sorted((root / "docs").glob("*.md"))]


def sentences(text: str) -> Iterator[str]:
    """Sentences of a page outside of code, tables and headings."""
    text = re.sub(r"^(`{3,}|:{3,}|\$\$).*?^\1 *$", "", text, flags=re.MULTILINE | re.DOTALL)
    for block in re.split(r"\n\s*\n|^(?=- |\d+\. |#)", text, flags=re.MULTILINE):
        if not block.lstrip().startswith(("|", "#")):
            words = " ".join(re.sub(r"\]\([^)]*\)", "]", block).split())
            yield from (one for one in re.split(r"(?<=[.!?:])\s+(?=[A-Z\"*`\[])", words) if len(one.split()) > 2)


def main(number: int = 10) -> None:
    """Print how many sentences are long or odd, and the worst of either kind with their page."""
    every = [(page.name, one) for page in pages() for one in sentences(page.read_text(encoding="utf-8"))]
    longest = sorted(every, key=lambda pair: -len(pair[1].split()))
    odd = [pair for pair in every if ODD.search(re.sub(r"`[^`]*`", "", pair[1]))]
    long = sum(len(one.split()) >= LONG for _, one in every)
    print(f"{len(every)} sentences, {long} of {LONG} words or more, {len(odd)} odd")
    for kind, some in (("longest", longest), ("odd", odd)):
        for page, one in some[:number]:
            print(f"{kind}: {page}: {len(one.split())} words: {one}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
