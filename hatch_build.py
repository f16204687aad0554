"""The readme in the metadata of a package: without pictures and links that only a copy of the repository has."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

INSIDE = r"\((?![a-z]+:)[^)]*\)"  # of a link or picture: a path


def alone(readme: str) -> str:
    """Return Markdown without pictures by path; links by path keep their words."""
    return re.sub(rf"\[([^\]]*)\]{INSIDE}", r"\1", re.sub(rf"!\[[^\]]*\]{INSIDE}\n*", "", readme))


class Readme(MetadataHookInterface):
    """Gives the readme to the metadata."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set `readme`."""
        text = alone((Path(self.root) / "README.md").read_text(encoding="utf-8"))
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
