"""Recordings of robots: topics or messages, each with its own clock, as the columns of one table."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Array
from shipid.errors import DataError, suggest_name
from shipid.logs.formats import TopicsFormat

MOST_ITEMS = 20  # of an array that is a field: more are a picture, a cloud of points or a map
LARGEST_TABLE = 4e8  # numbers in the table of a recording: 3 GB
OFF_CLOCK = 60.0  # s between what a message says and when it came: more is another clock
Topics = dict[str, pd.DataFrame]
"""Topic -> a row for each message: `time` [s], and its fields that are numbers."""
TopicReader = Callable[[Path, Callable[[str], bool]], Topics]
"""(file, whether a topic is needed) -> the topics that are."""


def reads_topics(
    read: TopicReader,
) -> Callable[[Path, TopicsFormat, Sequence[str], object], pd.DataFrame]:
    """A reader of logs from one of topics: of the columns it reads the topics of those that are asked for."""

    def read_recording(file: Path, form: TopicsFormat, columns: Sequence[str], _: object = None) -> pd.DataFrame:
        asked = columns[1:] or form.topics

        def is_needed(topic: str) -> bool:
            return not asked or any(one == topic or one.startswith((f"{topic}.", f"{topic}[")) for one in asked)

        topics = read(file, is_needed)
        lacking = [name for name in form.topics if name not in topics] if asked is form.topics else []
        if lacking or not topics:
            known = sorted(read(file, lambda _: True))
            which = f"no topic {lacking[0]!r}: {suggest_name(lacking[0], known)}" if lacking else "none of its topics"
            alone = f"{which} is asked for: it has {', '.join(map(repr, known)) or 'none with a number'}"
            raise DataError(which if lacking else alone, file=file, path="format.topics")
        return join_topics(topics, file)

    return read_recording


def join_topics(topics: Topics, file: Path) -> pd.DataFrame:
    """One table: `time` [s], and columns `topic.field`, NaN where a topic has no message at a time."""
    rows, width = sum(map(len, topics.values())), sum(len(one.columns) - 1 for one in topics.values())
    if rows * width > LARGEST_TABLE:
        raise DataError(
            f"{rows} messages with {width} fields are no table: name the topics that are needed",
            file=file,
            path="format.topics",
        )
    parts = [one.drop_duplicates("time").set_index("time").add_prefix(f"{name}.") for name, one in topics.items()]
    return pd.concat(parts, axis=1).sort_index().rename_axis("time").reset_index()


def topic_rows(topics: Topics) -> list[dict[str, Any]]:
    """For each topic its name, count of messages, their rate [Hz], and names of its fields."""
    return [
        {
            "topic": name,
            "messages": len(one),
            "rate": (len(one) - 1) / long if (long := float(np.ptp(one["time"]))) > 0 else math.nan,
            "fields": ", ".join(map(str, one.columns.drop("time"))),
        }
        for name, one in sorted(topics.items())
    ]


def message_times(received: Array, stamps: Array) -> Array:
    """Times (N,) [s] of messages: their stamps where these rise and are of the clock by which they came, else that."""
    rise = np.isfinite(stamps).all() and bool(np.all(np.diff(stamps) > 0))
    return stamps if rise and abs(np.median(stamps - received)) < OFF_CLOCK else received


@contextmanager
def recording_errors(file: Path, what: str, library: str) -> Iterator[None]:
    """Turn a lacking library, and whatever it raises at a damaged file, into a DataError."""
    console = os.dup(2)
    try:
        with open(os.devnull, "wb") as silent, redirect_stdout(io.StringIO()):  # where some of them complain, in C too
            os.dup2(silent.fileno(), 2)
            yield
    except ImportError:
        message = f"{what} needs {library}: pip install 'shipid[robots]'"
        raise DataError(message, file=file, path="format.kind") from None
    except MemoryError:  # for a count that is false, or a recording that is large
        message = f"{what} that asks for more memory than there is: damaged, or name the topics that are needed"
        raise DataError(message, file=file, path="format.topics") from None
    except (DataError, PermissionError):
        raise
    except Exception as error:  # these libraries raise any of a dozen
        message = f"not {what}, or damaged ({type(error).__name__}): set [format] kind"
        raise DataError(message, file=file, path="format.kind") from None
    finally:
        os.dup2(console, 2)
        os.close(console)
