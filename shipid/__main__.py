"""`python -m shipid`: the command line."""

import gc
import io
import os
import signal
import sys

FEW_LOOKS = 100_000  # objects made between two looks for garbage: imports make many objects, and no garbage


def run_command_line() -> None:
    """Run the command line; Ctrl-C while it is being imported ends it as quietly as later."""
    try:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read by NumPy's import; on a busy machine waits cost half
        os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # to look for them in all packages takes 8 ms
        gc.set_threshold(FEW_LOOKS)
        if isinstance(sys.stdout, io.TextIOWrapper):  # write out signs that a terminal cannot show
            sys.stdout.reconfigure(errors="backslashreplace")
        from shipid.cli import main

        main()
    except KeyboardInterrupt:  # in the lines above, or in the last ones of `main`
        sys.stderr.write("interrupted\n")
        sys.exit(130)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C pressed twice: the exit status is that of the first
        gc.freeze()  # the end of the process looks for garbage once more: it frees all in any case


if __name__ == "__main__":
    run_command_line()
