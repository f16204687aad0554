"""`python -m shipid`: the command line."""

import os
import sys


def run() -> None:
    """Run the command line; Ctrl-C while it is being imported ends it as quietly as later."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read by NumPy's import; on a busy machine waits cost half
    try:
        from shipid.cli import main
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)
    main()


if __name__ == "__main__":
    run()
