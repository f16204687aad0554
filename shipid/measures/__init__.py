"""Measures of standard manoeuvres, recorded or simulated: arrays in, named numbers out."""

from shipid.measures.spiral import reverse_spiral, spiral
from shipid.measures.stopping import stop
from shipid.measures.turning import pull_out, turning
from shipid.measures.zigzag import zigzag

__all__ = ["pull_out", "reverse_spiral", "spiral", "stop", "turning", "zigzag"]
