"""What the tests of answers share with those of studies."""

from __future__ import annotations

from tests.study.conftest import made as made
from tests.study.conftest import recorded as recorded
