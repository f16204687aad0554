"""The page of a study of several parts: its methods over all of them."""

from __future__ import annotations

from functools import partial

from shipid.report.methods import THE_METHODS
from shipid.report.page import write_page

write_comparison = partial(write_page, "methods", {"the-methods": THE_METHODS})
