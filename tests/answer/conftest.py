"""What the tests of answers share with those of studies."""

from tests.study.conftest import made as made
from tests.study.conftest import recorded as recorded
