"""Measures of standard manoeuvres, recorded or simulated: arrays in, named numbers out, by kind of manoeuvre."""

from __future__ import annotations

from collections.abc import Callable

from shipid.measures.record import Measures, Record
from shipid.measures.spiral import reverse_spiral, spiral
from shipid.measures.stopping import stop
from shipid.measures.turning import pull_out, turning
from shipid.measures.zigzag import zigzag

MEASURES: dict[str, Callable[[Record], Measures]] = {
    "zigzag": zigzag,
    "turning": turning,
    "pull-out": pull_out,
    "spiral": spiral,
    "reverse-spiral": reverse_spiral,
    "stop": stop,
}
"""Kind of manoeuvre -> function that computes its measures from a record."""
