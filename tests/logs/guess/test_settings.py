"""The settings of the search are documented, each with its reason."""

from __future__ import annotations

import re
from dataclasses import fields

from shipid.logs.guess.settings import SearchSettings


def test_every_setting_has_its_reason() -> None:
    said = re.findall(r"(\w+(?:, \w+)*) :", SearchSettings.__doc__ or "")
    assert sorted(name for names in said for name in names.split(", ")) == sorted(
        one.name for one in fields(SearchSettings)
    )
