"""Run the campaign: `python -m tests.faults [--scale 5] [--seed 0] [--only killed]`; it ends with 1 on failures."""

from __future__ import annotations

import argparse
import sys
import time
import warnings

from tests.faults.campaign import ROWS, campaign
from tests.faults.trials import table


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=1.0, help="1: a fifth of the trials; 5: all")
    parser.add_argument("--seed", type=int, default=0, help="of all that is drawn")
    parser.add_argument("--only", default="", help=f"rows, of {', '.join(ROWS)}")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    begun = time.perf_counter()
    by_row = campaign(given.scale, given.seed, tuple(filter(None, given.only.split(","))))
    print(table(by_row))
    print(f"{time.perf_counter() - begun:.0f} s, seed {given.seed}, scale {given.scale:g}")
    return int(any(one.failed for outcomes in by_row.values() for one in outcomes))


if __name__ == "__main__":
    sys.exit(main())
