"""Workers: every task once, whoever does it; errors and deaths are reported; no process outlives its iterator."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from shipid.errors import ShipidError
from shipid.study.workers import LONGEST, METHOD, ONE_THREAD, on_workers
from tests.documented import code
from tests.study.tiny import TINY

forked = pytest.mark.skipif(METHOD != "forkserver", reason="workers are forked on Linux only")


@forked
def test_workers_have_imported_all_use_one_thread_and_ignore_interrupts() -> None:
    """Asked of a worker of a fresh process, whose environment says two threads."""
    program = """
import multiprocessing, os, signal, sys
from shipid.study.workers import ONE_THREAD, PRELOADED, import_for_workers
import_for_workers()
ask = "import os, signal, sys; imported = int({} <= sys.modules.keys()); "
ask += "print(imported, *(os.environ[n] for n in {}), {}, flush=True)"
ask = ask.format({*PRELOADED, "torch"}, list(ONE_THREAD), "int(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)")
process = multiprocessing.get_context("forkserver").Process(target=exec, args=(ask,))
process.start()
process.join()
"""
    environment = os.environ | dict.fromkeys(ONE_THREAD, "2")
    process = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    )
    assert process.stdout.split() == ["1"] * (1 + len(ONE_THREAD) + 1), process.stderr


@pytest.mark.parametrize("count", [1, 2, 3])
def test_every_task_is_done_once(count: int) -> None:
    tasks = [4.0, 1.0, 0.0, 9.0][: 4 if count < 3 else 2]  # also fewer tasks than processes
    assert sorted(on_workers(math.sqrt, tasks, count)) == [(task, task**0.5) for task in sorted(tasks)]
    assert not multiprocessing.active_children()


def test_workers_start_whatever_the_length_of_the_temporary_folder(tmp_path: Path) -> None:
    """A path of a socket has 107 bytes at most; batch systems give every job a folder of its own."""
    program = """
import math
from shipid.study.workers import import_for_workers, on_workers
if __name__ == "__main__":
    import_for_workers()
    print(list(on_workers(math.sqrt, [4.0], 1)))
"""
    (tmp_path / "program.py").write_text(program)
    with tempfile.TemporaryDirectory(dir="/tmp") as short:  # that of a test may be too long itself
        folder = Path(short) / ("t" * (LONGEST + 1 - len(short) - 1))
        folder.mkdir()
        environment = os.environ | {"TMPDIR": str(folder)}
        command = [sys.executable, tmp_path / "program.py"]
        process = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert process.stdout == "[(4.0, 2.0)]\n", process.stderr


@pytest.mark.parametrize("size", [1, 10_000_000])  # what workers get, also more than a pipe holds
def test_a_script_without_its_guard_is_named(size: int, tmp_path: Path) -> None:
    """Each worker imports the script, and would start workers; the error was that memory had run out."""
    program = f"""
from functools import partial
from shipid.study.workers import import_for_workers, on_workers
print(list(on_workers(partial(max, bytes({size})), [b"1"], 1)))
"""
    (tmp_path / "program.py").write_text(program)
    command = [sys.executable, tmp_path / "program.py"]
    process = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    place = f"shipid.errors.ShipidError: {tmp_path / 'program.py'}: "
    assert process.stderr.splitlines()[-1].startswith(f"{place}each worker imports your script: put what it does below")
    assert process.stderr.count("Traceback") == 1
    assert not process.stdout


def gone() -> None:
    raise ModuleNotFoundError("my module is gone")


class Gone:
    """Work that cannot be made again where it is received."""

    def __reduce__(self) -> tuple[object, tuple[()]]:
        return gone, ()

    def __call__(self, task: float) -> float:
        return task


def test_work_that_cannot_be_received_is_one_line() -> None:
    with pytest.raises(ShipidError, match=r"my module is gone.: write methods and terms into a file"):
        list(on_workers(Gone(), [1.0, 2.0], 2))
    assert not multiprocessing.active_children()


def test_an_error_arises_here_and_keeps_where_it_arose() -> None:
    with pytest.raises(ValueError, match="math domain") as caught:
        list(on_workers(math.sqrt, [-1.0], 1))
    assert "_answer" in str(caught.value.__cause__)
    assert not multiprocessing.active_children()


def test_a_killed_worker_is_one_line() -> None:
    with pytest.raises(ShipidError, match="a worker was killed"):
        list(on_workers(signal.raise_signal, [signal.SIGKILL, signal.SIGKILL], 2))
    assert not multiprocessing.active_children()


def make_what_cannot_be_sent(_: int) -> object:
    return lambda: None


def test_what_cannot_be_sent_is_an_error_that_says_so() -> None:
    with pytest.raises(ShipidError, match=r"cannot leave its process .*lambda.*: give it classes and functions of a"):
        list(on_workers(make_what_cannot_be_sent, [1], 1))
    assert not multiprocessing.active_children()


def ignore(number: signal.Signals) -> None:
    signal.signal(number, signal.SIG_IGN)


def test_a_worker_that_ignores_signals_ends() -> None:
    """Before, a study never ended where a user's method, or a library of it, answers SIGTERM."""
    assert list(on_workers(ignore, [signal.SIGTERM], 1)) == [(signal.SIGTERM, None)]
    assert not multiprocessing.active_children()


def test_closing_ends_busy_workers() -> None:
    results = on_workers(time.sleep, [0, 3600], 2)
    assert next(results) == (0, None)
    results.close()  # type: ignore[attr-defined]
    assert not multiprocessing.active_children()


@pytest.mark.skipif(sys.platform == "win32", reason="processes of Windows have no groups to interrupt")
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_workers_end_with_their_parent_without_noise(sent: signal.Signals) -> None:
    """Ctrl-C goes to all processes of a terminal, a kill to one; what all inherited is closed when all have ended."""
    program = """
import signal, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # jobs in the background of a shell ignore it
from shipid.study.workers import import_for_workers, on_workers
import_for_workers()
try:
    for task, _ in on_workers(time.sleep, [0, 3600, 3600], 2):
        print("begun", flush=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
    command, pipe = [sys.executable, "-c", program], subprocess.PIPE
    with tempfile.TemporaryDirectory(dir="/tmp") as short:  # that of a test may be too long for a socket
        environment = os.environ | {"TMPDIR": short}
        with subprocess.Popen(command, env=environment, stdout=pipe, stderr=pipe, start_new_session=True) as process:
            assert process.stdout.readline() == b"begun\n"
            if sent == signal.SIGINT:
                os.killpg(process.pid, sent)
            else:
                process.kill()
            out, err = process.communicate(timeout=600)
        assert out == (b"interrupted\n" if sent == signal.SIGINT else b"")
        assert b"Traceback" not in err
        assert sent == signal.SIGKILL or not err
        assert sent == signal.SIGKILL or not os.listdir(short)


ROOT = Path(__file__).parents[2]
USERS_METHOD = code("A method")[0]
LISTED = """
from shipid.hybrid.methods import METHODS
METHODS["linear"] = Linear
"""
TERM = code("A term")[1]
SHIP = 'extends = "gunnerus-28.9"\n[hull.skeg]\nx = -10.0\nA = 6.0\nC = 1.8\nsource = "-"\n'
RUN = f"""
import shipid
if __name__ == "__main__":
    change = {{"method": [{{"name": "own", "kind": "linear", "trials": 2}}], "grid.N_D": [4]}}
    print(len(shipid.run({str(TINY)!r}, set=change, out="run", workers=1).cells))
"""
RUN_TERM = f"""
import shipid
if __name__ == "__main__":
    change = {{"truth.vessel": "./ship.toml", "family.0.base": "./ship.toml", "grid.N_D": [4]}}
    print(len(shipid.run({str(TINY)!r}, set=change, out="run", workers=1).cells))
"""


def ended(folder: Path, *command: str) -> str:
    """The last line that a command of Python prints, to either stream."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(folder)])}
    done = subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        env=environment,
        check=False,
    )
    return (done.stdout + done.stderr).splitlines()[-1]


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        (USERS_METHOD + LISTED + RUN, "there it does not go (AttributeError: "),
        (TERM + RUN_TERM, "workers lack the term 'hull.skeg': write it into a file that they can import"),
    ],
)
def test_code_that_workers_lack_is_one_line(cells: str, words: str, tmp_path: Path) -> None:
    """A method and a term of cells of a notebook."""
    (tmp_path / "ship.toml").write_text(SHIP)
    line = ended(tmp_path, "-c", cells)
    assert line.startswith("shipid.errors.ShipidError: ")
    assert words in line


@pytest.mark.slow
def test_code_in_a_file_or_for_this_process_runs(tmp_path: Path) -> None:
    """The line of a method, or of a term, may be in a cell: a worker imports the class. It ended with a KeyError."""
    (tmp_path / "mine.py").write_text(USERS_METHOD)
    assert ended(tmp_path, "-c", "from mine import Linear" + LISTED + RUN) == "4"
    assert ended(tmp_path, "-c", USERS_METHOD + LISTED + RUN.replace("workers=1", "workers=0")) == "4"
    (tmp_path / "ship.toml").write_text(SHIP)
    function, listed = TERM.split("\n\n\nTERMS")
    (tmp_path / "skeg.py").write_text(function)
    cell = f"from skeg import skeg\nfrom shipid.physics import TERMS, Term\nTERMS{listed}{RUN_TERM}"
    assert ended(tmp_path, "-c", cell.replace('"run"', '"term"')) == "4"
    assert ended(tmp_path, "-c", TERM + RUN_TERM.replace('"run", workers=1', '"other", workers=0')) == "4"


def test_a_script_from_standard_input_is_named(tmp_path: Path) -> None:
    alone = RUN.replace('"linear", "trials": 2', '"alone"')
    piped = f"import subprocess, sys; subprocess.run([sys.executable, '-'], input={alone!r}, text=True)"
    words = "a script from standard input cannot start workers: save it as a file, and run that"
    assert ended(tmp_path, "-c", piped) == f"shipid.errors.ShipidError: {words}"
    assert not (tmp_path / "run").exists()
