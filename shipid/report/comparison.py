"""The page of a study of several parts: its methods over all of them."""

from __future__ import annotations

from pathlib import Path

from shipid.report.methods import SECTION, MethodsContent
from shipid.report.page import page, write


def write_comparison(content: MethodsContent, file: Path) -> Path:
    """Write the page as one HTML file that makes no request; returns the file. Raises ResultError if it cannot."""
    return write(page(content, {"the-methods": SECTION}, "methods"), file)
