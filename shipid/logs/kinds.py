"""Kinds of runs, and the words in the name of a run that say one."""

from __future__ import annotations

import re

RANDOM, LOW_SPEED, COASTING, MIXED = "random", "manoeuvring at low speed", "coasting", "mixed"
WORDS = {
    "zigzag": r"zz|zig\W?zag\w*|zig|zag|z|z\W?\d+\W\d+|zickzack|sikksakk|siksak",
    "turning": r"tc[sp]?|turn\w*|circles?|drehkreis|svingsirkel|williamson",
    LOW_SPEED: r"berth\w*|dock\w*|undock\w*|moor\w*|harbou?r\w*|low\W?speed|station\w*|dp",
    COASTING: r"coast\w*|drift\w*|freewheel\w*",
    "stop": r"stop\w*|crash\w*",
    RANDOM: r"random\w*|rnd|rand|aprbs|prbs|multisine\w*|excitation\w*|^steps$",
    "spiral": r"spiral\w*|dieudonne|bech",
    "pull-out": r"pull\W?out\w*",
    "speed run": r"speed\W?runs?|speed\W?trials?|speed|accel\w*|decel\w*|mile",
    MIXED: r"mixed|mix|free\W?(?:drive|driving|run)",
    "transit": r"transits?|straight\w*|course\w*",
}
"""Kind -> regular expression of the words in a run's name that say it; the first kind that fits counts."""


def kind_in_name(name: str) -> str | None:
    """Kind that the name of a run says in words, as in `ZZ_10_10` or `berthing 3`; None if none."""
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).replace("_", " ").lower()
    text = re.sub(r"(?<=[a-z])(?=\d)|(?<=\d)(?=[a-z])", " ", text)
    return next((kind for kind, words in WORDS.items() if re.search(rf"\b(?:{words})\b", text)), None)
