"""Rows of the campaign: folders of results that are killed, filled up, shared and damaged, and then continued."""

from __future__ import annotations

import atexit
import errno
import io
import json
import os
import random
import resource
import shutil
import signal
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pyarrow.parquet

from shipid.data.checks import check_dataset
from shipid.data.dataset import read_dataset
from shipid.errors import ShipidError
from shipid.files import TEMPORARY
from shipid.predictor import Predictor
from shipid.study import seals
from shipid.study.check import check_folder
from shipid.study.plan import Plan
from shipid.study.results import read_results
from shipid.study.run import prepare_study, run_study
from shipid.study.seals import has_writer
from tests.faults.trials import PATIENCE, Failure
from tests.study.tiny import tiny_plan

PLACE = "/dev/shm" if Path("/dev/shm").is_dir() else None
"""Where the folders of trials are: in memory, where syncing takes no time."""
CALLS = ("mkdir", "replace", "rename", "link", "unlink", "rmdir", "fsync", "utime", "truncate")
"""Calls of the system by which a folder changes, beside each line that is appended to a file: a run is stopped before,
within and after each."""
KILLS = 4  # of a folder in a trial
FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def run_here(plan: Plan, folder: Path, workers: int = 0, **means: Any) -> None:
    """Run a plan in this process, which is a fork, or in workers that fork from it."""
    with patch("shipid.study.workers.METHOD", "fork"):
        list(run_study(plan, folder, workers=workers, **means))


def searched_plan(folder: Path, changes: Mapping[str, Any] | None = None) -> Plan:
    """Plan of the tiny study with three trials in a search, so that one may be stopped between two of them."""
    return tiny_plan(folder, {"method.kernel.trials": 3, **(changes or {})})


@cache
def reference() -> tuple[Path, dict[str, bytes], int]:
    """A finished run, the bytes of its cells and batches, and how many calls it makes."""
    folder = Path(tempfile.mkdtemp(prefix="faults-", dir=PLACE))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    count = [0]

    def counted(_name: str, call: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        count[0] += 1
        return call(*arguments, **named)

    plan = searched_plan(folder)
    run_here(plan, folder / "warm")
    with intercepted(counted):
        run_here(plan, folder / "run")
    return folder / "run", stored(folder / "run"), count[0]


@cache
def donor() -> Path:
    """A finished run of another world, whose files have the names of those of the reference."""
    place = reference()[0].parent
    run_here(searched_plan(place, {"truth.seed": 7}), place / "donor")
    return place / "donor"


@contextmanager
def intercepted(instead: Callable[..., Any]) -> Iterator[None]:
    """Give every call of `CALLS`, and each append, to `instead`: (name, call, arguments, named arguments) -> result."""

    class Appended(io.FileIO):
        def write(self, line: Any) -> int:
            return instead("append", super().write, (line,), {})  # type: ignore[no-any-return]

    def opened(file: Any, mode: str = "r", *arguments: Any, **named: Any) -> Any:
        return Appended(file, mode) if mode == "ab" else plain(file, mode, *arguments, **named)

    def replacement(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *arguments, **named: instead(name, call, arguments, named)

    plain = io.open
    with ExitStack() as stack:
        for name in CALLS:
            stack.enter_context(patch.object(os, name, replacement(name, getattr(os, name))))
        for place in ("io.open", "builtins.open"):
            stack.enter_context(patch(place, opened))
        yield


def stored(folder: Path) -> dict[str, bytes]:
    """What a run has computed: bytes of the predictors, and the rows without the seconds they took."""
    files = {f"cells/{file.name}": file.read_bytes() for file in (folder / "cells").glob("*.npz") if not _is_copy(file)}
    for file in (folder / "batches").glob("*.json"):
        if _is_copy(file):
            continue
        rows = json.loads(file.read_text())
        for row in rows:
            row.pop("seconds")
            row["trials"] = [{k: v for k, v in trial.items() if k != "seconds"} for trial in row["trials"]]
        files[f"batches/{file.name}"] = json.dumps(rows).encode()
    files["study.toml"] = (folder / "study.toml").read_bytes()
    return files


def _is_copy(file: Path) -> bool:
    """Whether a file is one that a program made which synchronises folders."""
    return " (1)" in file.name


def child(work: Callable[[], Any], limit: float = 60.0) -> int:
    """Exit code of work in a forked process: 0 done, 1 refused in one line, 2 traceback; negative for a signal."""
    process = start(work)
    return finish(process, limit)


def start(work: Callable[[], Any]) -> int:
    """Start work in a forked process; its id."""
    process = os.fork()
    if process:
        return process
    code = 2
    try:
        work()
        code = 0
    except (ShipidError, OSError) as error:
        code = 1
        if os.environ.get("FAULTS_WORDS"):
            print(error, flush=True)
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        os._exit(code)


def finish(process: int, limit: float = 60.0) -> int:
    """Exit code of a process; it is killed after a limit [s], which is a failure."""
    end = time.monotonic() + PATIENCE * limit
    while time.monotonic() < end:
        done, status = os.waitpid(process, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.01)
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    raise Failure("hang", f"more than {limit:g} s")


def _same_as_reference(folder: Path, what: str) -> None:
    """Raise Failure unless a folder holds the numbers of an undisturbed run, sealed, and nothing else."""
    wanted, present = reference()[1], stored(folder)
    for name in sorted(wanted.keys() | present.keys()):
        if wanted.get(name) != present.get(name):
            raise Failure("mixed", what, name)
    if faults := seals.sealed_faults(folder):
        raise Failure("not sealed", what, faults[0].file)
    left = [*folder.rglob(f"{TEMPORARY}*"), *folder.parent.glob(f"{TEMPORARY}*")]
    if left:
        raise Failure("left over", what, left[0].name)
    if has_writer(folder):
        raise Failure("left over", what, "a lock")


@contextmanager
def a_place() -> Iterator[Path]:
    """A folder of one trial."""
    with tempfile.TemporaryDirectory(prefix="faults-", dir=PLACE) as folder:
        yield Path(folder)


def _continued(place: Path, what: str) -> None:
    """Run the plan to its end in a folder, as often as a patient user would, and compare."""
    plan = searched_plan(place)
    code = child(lambda: run_here(plan, place / "run"))
    if code:
        raise Failure("not resumed", what, f"exit code {code}")
    _same_as_reference(place / "run", what)


def killed(seed: int) -> None:
    """A run or a worker is killed before, within or after one of its changes of the folder, four times, and continued.

    Each run goes on where the one before it was killed.
    """
    rng, calls, words = random.Random(seed), reference()[2], list[str]()
    with a_place() as place:
        plan, folder = searched_plan(place), place / "run"
        while len(words) < KILLS:
            at, when = rng.randrange(calls // rng.choice([1, 3, 10])), rng.choice(["before", "within", "after"])
            workers = rng.choice([0, 0, 2])
            words.append(f"{when} call {at}, {workers} workers")
            code = child(lambda: _stopped(plan, folder, at, when, workers))  # noqa: B023
            while (
                workers and folder.is_dir() and has_writer(folder)
            ):  # workers hold the lock of the process they are of
                time.sleep(0.01)
            if code == 0:  # it ended before that call
                _same_as_reference(folder, " and ".join(words))
                shutil.rmtree(folder)
                words.pop()
            elif code != -signal.SIGKILL and not (code == 1 and workers):
                raise Failure("not resumed", " and ".join(words), f"exit code {code}")
        _continued(place, " and ".join(words))


def _stopped(plan: Plan, folder: Path, at: int, when: str, workers: int = 0) -> None:
    _killed_at(at, lambda: run_here(plan, folder, workers), when)


def _killed_at(at: int, work: Callable[[], Any], when: str = "after") -> None:
    """Do work that is killed before, within or after the call `at` that changes a folder."""
    count = [0]

    def stop(name: str, call: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        count[0] += 1
        if count[0] <= at:
            return call(*arguments, **named)
        if when == "within" and name == "fsync":
            with suppress(OSError):
                os.ftruncate(arguments[0], os.fstat(arguments[0]).st_size // 2)
        if when == "within" and name == "append":
            call(arguments[0][: len(arguments[0]) // 2])
        if when == "after":
            call(*arguments, **named)
        os.kill(os.getpid(), signal.SIGKILL)

    with intercepted(stop):
        work()


def full(seed: int) -> None:
    """The disk is full from one change on (an intercepted call, or a limit of file size), then it has space again."""
    rng, calls = random.Random(seed), reference()[2]
    with a_place() as place:
        plan = searched_plan(place)
        at, limit = rng.randrange(calls), rng.choice([0, 100, 1000, 5000, 9800, 20000, 27050])
        by_size = seed % 2 == 0
        count = [0]

        def fail(name: str, call: Callable[..., Any], arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
            count[0] += 1
            if count[0] > at and name in ("mkdir", "fsync", "replace", "link", "append"):
                raise FULL
            return call(*arguments, **named)

        def work() -> None:
            if by_size:
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
                run_here(plan, place / "run")
            else:
                with intercepted(fail):
                    run_here(plan, place / "run")

        what = f"files of at most {limit} bytes" if by_size else f"no space from call {at} on"
        code = child(work)
        if code not in (0, 1):
            raise Failure("traceback", what, f"exit code {code}")
        if list(place.rglob(f"{TEMPORARY}*")) and by_size:
            raise Failure("left over", what)
        _continued(place, what)


def together(seed: int) -> None:
    """Two, three or twenty runs of one plan in one folder at once, some killed: one works, the others are refused."""
    rng = random.Random(seed)
    with a_place() as place:
        plan, count = searched_plan(place), rng.choice([2, 3, 20])
        pause, victims = rng.choice([0.0, 0.1, 0.5]) if count < 20 else 0.0, rng.choice([0, 0, 1, count // 10])
        runs = []
        for _ in range(count):
            runs.append(start(lambda: run_here(plan, place / "run")))
            time.sleep(pause)
        for one in rng.sample(runs, victims):
            with suppress(ProcessLookupError):
                os.kill(one, signal.SIGKILL)
            time.sleep(rng.choice([0.0, 0.3]))
        codes = [finish(one) for one in runs]
        if not {*codes} <= {0, 1, -signal.SIGKILL} or (not victims and 0 not in codes):
            raise Failure("not one alone", f"exit codes {codes}")
        _continued(place, f"{len(runs)} runs at once")
        other = searched_plan(place, {"truth.seed": 7})
        if child(lambda: run_here(other, place / "run")) != 1:
            raise Failure("mixed", "another plan was not refused")
        _same_as_reference(place / "run", "after another plan")


def shards(seed: int) -> None:
    """Shards of a plan in processes, killed or damaged, begun again and taken in by a run that may be killed, too."""
    rng, calls, count = random.Random(seed), reference()[2], random.Random(seed).choice([1, 2, 3])
    with a_place() as place:
        plan, folder = searched_plan(place), place / "run"
        for _ in prepare_study(plan, folder):
            pass

        def shard(number: int) -> None:
            run_here(plan, folder, shard=(number, count))

        words = []
        for number in range(1, count + 1):
            for _ in range(rng.choice([0, 1, 1])):
                at = rng.randrange(calls)
                words.append(f"shard {number} of {count} killed at call {at}")
                child(lambda number=number, at=at: _killed_at(at, lambda: shard(number)))  # type: ignore[misc]
            if rng.random() < 0.8 and child(lambda number=number: shard(number)):  # type: ignore[misc]
                raise Failure("not resumed", *words)
        if rng.random() < 0.4 and any((folder / "shards").glob("*/*.toml")):
            words.append(_damage(folder / "shards", rng))
        elif rng.random() < 0.6:
            at = rng.randrange(calls)
            words.append(f"killed at call {at}")
            child(lambda: _stopped(plan, folder, at, rng.choice(["before", "within", "after"])))
        run_here(plan, folder)  # a refusal ends the trial here
        shutil.rmtree(folder / "shards", ignore_errors=True)
        _same_as_reference(folder, ", ".join(words))


def another_user(seed: int) -> None:
    """The folder belongs to somebody else, or can only be read: one line, not a byte is changed, and it can be read."""
    rng = random.Random(seed)
    if os.getuid():
        return  # nobody can be somebody else
    with a_place() as place:
        place.chmod(0o755)
        finished = rng.random() < 0.5
        if finished:
            shutil.copytree(reference()[0], place / "run")
        else:
            at = rng.randrange(reference()[2] // 4, reference()[2])
            child(lambda: _stopped(searched_plan(place), place / "run", at, "after"))
        theirs, kind = (
            searched_plan(place),
            rng.choice(["root's", "root's, some files one's own", "one's own, read only"]),
        )
        every = [place, *place.rglob("*")]
        for one in every if kind != "root's" else ():
            if rng.random() < 0.5 or kind.endswith("only"):
                os.chown(one, 65534, 65534, follow_symlinks=False)
                one.chmod(0o555 if one.is_dir() else 0o444) if kind.endswith("only") else None
        before = {one: one.read_bytes() for one in every if one.is_file()}

        def visit() -> None:
            os.setgroups([])
            os.setgid(65534)
            os.setuid(65534)
            with suppress(ShipidError):
                read_results(place / "run")
            with suppress(ShipidError):
                check_folder(place / "run")
            run_here(theirs, place / "run")

        code = child(visit)
        if code not in (0, 1):
            raise Failure("traceback", kind, f"exit code {code}")
        changed = [one.name for one in before if not one.is_file() or one.read_bytes() != before[one]]
        if changed and kind != "root's, some files one's own":
            raise Failure("mixed", kind, *changed)
        for one in [place, *place.rglob("*")]:
            os.chown(one, 0, 0, follow_symlinks=False)
            one.chmod(0o755 if one.is_dir() else 0o644)
        _continued(place, kind)


def clocks(seed: int) -> None:
    """The clock of the machine jumps by hours to years while a run works and is killed; files are of the future."""
    rng, calls, now = random.Random(seed), reference()[2], time.time
    with a_place() as place:
        plan, shift = searched_plan(place), [0.0]

        def jump() -> float:
            if rng.random() < 0.2:
                shift[0] = rng.choice([-1, 1]) * rng.choice([1e-3, 3600.0, 90000.0, 3e7, 1e9])
            return now() + shift[0]

        for _ in range(rng.choice([1, 2])):
            at = rng.randrange(calls)
            with patch("time.time", jump):
                child(lambda at=at: _stopped(plan, place / "run", at, "after"))  # type: ignore[misc]
            for one in place.rglob("*"):
                moment = now() + rng.choice([-1e9, -90000.0, 0.0, 90000.0, 1e9])
                os.utime(one, (moment, moment), follow_symlinks=False)
        with patch("time.time", jump):
            _continued(place, "a clock that jumps")


def another_version(seed: int) -> None:
    """A folder as of another version, its seals right: refused in one line, or these numbers."""
    rng = random.Random(seed)
    with a_place() as place:
        shutil.copytree(reference()[0], place / "run")
        folder, words = place / "run", []
        texts = sorted([*folder.glob("*.json"), *folder.glob("batches/*.json"), folder / "study.toml"])
        for _ in range(rng.choice([1, 1, 2])):
            file = rng.choice(texts)
            words.append(_other_keys(file, rng))
            for seal in seals.seal_names(folder):
                seals.write_seal(folder, seal, [folder / name for name in seals.named_files(folder, seal)])
        what = ", ".join(words)
        with suppress(ShipidError):
            read_results(folder).cells.to_csv(place / "x.csv")
        with suppress(ShipidError):
            check_folder(folder)
        run_here(searched_plan(place), folder)  # a refusal ends the trial here
        kept = [{file.name for file in (one / "cells").iterdir()} for one in (folder, reference()[0])]
        if kept[0] != kept[1]:
            raise Failure("mixed", what)


def _other_keys(file: Path, rng: random.Random) -> str:
    """Give an entry of a JSON or TOML file another name or kind, leave one out, or add one."""
    if file.suffix == ".toml":
        lines = file.read_text().splitlines()
        place = rng.choice([number for number, line in enumerate(lines) if "=" in line])
        key, _, value = lines[place].partition("=")
        other = rng.choice([f"{key.strip()}_s = {value}", "", f"{lines[place]}\nnewer = 1", f'{key} = "auto"'])
        file.write_text("\n".join([*lines[:place], other, *lines[place + 1 :]]) + "\n")
        return f"{file.name}: {other!r}"
    content = node = json.loads(file.read_text())
    while node:
        key = rng.choice(list(node)) if isinstance(node, dict) else rng.randrange(len(node))
        if isinstance(node[key], dict | list) and node[key] and rng.random() < 0.7:
            node = node[key]
            continue
        kind = rng.choice(["gone", "renamed", "added", "other"])
        if kind == "other" or isinstance(node, list):
            node[key] = rng.choice([None, "x", -1, 2.5, [], {}, True, [1], {"a": 1}])
        elif kind == "added":
            node["newer"] = {"a": [1]}
        else:
            node |= {f"{key}_s": node[key]} if kind == "renamed" else {}
            del node[key]
        break
    file.write_text(json.dumps(content))
    return f"{file.name}: {key} {kind}"


def two_plans(seed: int) -> None:
    """Two plans begin in one folder at once: one is refused in one line, the other ends as if alone."""
    rng = random.Random(seed)
    with a_place() as place:
        plans = [searched_plan(place), searched_plan(place, {"truth.seed": 7})]
        if rng.random() < 0.5:
            (place / "run").mkdir()
        runs = []
        for plan in plans:
            runs.append(start(lambda plan=plan: run_here(plan, place / "run")))  # type: ignore[misc]
            time.sleep(rng.choice([0.0, 0.0, 0.01, 0.1]))
        codes = [finish(one) for one in runs]
        if sorted(codes) != [0, 1]:
            raise Failure("mixed", f"exit codes {codes}")
        if codes[0] == 0:
            _same_as_reference(place / "run", "two plans at once")


def damaged(seed: int) -> None:
    """A finished folder, or that of a killed run, with one to three damages: refused in one line, or whole."""
    rng = random.Random(seed)
    with a_place() as place:
        if rng.random() < 0.5:
            shutil.copytree(reference()[0], place / "run")
        else:
            at = rng.randrange(reference()[2] // 4, reference()[2])
            child(lambda: _stopped(searched_plan(place), place / "run", at, "after"))
        words = [_damage(place / "run", rng) for _ in range(rng.choice([1, 1, 2, 3]))]
        what = ", ".join(words)
        with suppress(ShipidError):
            results = read_results(place / "run")
            wanted = reference()[1]
            for row in results.cells["cell"]:
                if (place / "run" / "cells" / f"{row}.npz").read_bytes() != wanted[f"cells/{row}.npz"]:
                    raise Failure("mixed", what, "read without a word")
        with suppress(ShipidError):
            check_folder(place / "run")
        plan = searched_plan(place)
        run_here(plan, place / "run")  # a refusal ends the trial here
        _same_as_reference(place / "run", what)


def _damage(folder: Path, rng: random.Random) -> str:
    """Damage one file; its name and how. What keeps a second writer out is left alone."""
    files = sorted(file for file in folder.rglob("*") if file.is_file() and not file.name.startswith("."))
    file = rng.choice(files)
    name = f"{file.relative_to(folder)}"
    kinds = ["gone", "empty", "half", "byte", "swapped", "rubbish", "folder", "link", "grown", "edited", "edited"]
    kind = rng.choice([*kinds, "foreign", "foreign", "copied"])
    content = file.read_bytes()
    if kind == "gone":
        file.unlink()
    elif kind == "foreign":
        _take_over(folder, name, rng)
    elif kind == "copied":
        shutil.copyfile(file, file.with_name(f"{file.stem} (1){file.suffix}"))
    elif kind in ("empty", "half", "rubbish", "grown"):
        changed = {"empty": b"", "half": content[: len(content) // 2], "rubbish": rng.randbytes(300)}
        file.write_bytes(changed.get(kind, content + b"\0" * 9))
    elif kind == "byte" and content:
        place = rng.randrange(len(content))
        file.write_bytes(content[:place] + bytes([content[place] ^ (1 << rng.randrange(8))]) + content[place + 1 :])
    elif kind == "swapped":
        other = rng.choice([one for one in files if one.suffix == file.suffix])
        if other.exists() and other.is_file():
            file.write_bytes(other.read_bytes())
            other.write_bytes(content)
    elif kind == "folder":
        file.unlink()
        file.mkdir()
    elif kind == "link":
        file.unlink()
        file.symlink_to(file.parent / "nowhere" / file.name if rng.random() < 0.5 else "/dev/null")
    else:
        with suppress(ValueError, OSError, EOFError, zipfile.BadZipFile):  # an earlier damage made it unreadable
            _edit(file, rng)
    return f"{name} {kind}"


def _take_over(folder: Path, name: str, rng: random.Random) -> None:
    """Put a file of another world in the place of one, alone or with all that its seal names, as in a merged folder."""
    names = {name}
    if rng.random() < 0.7:
        for seal in (donor() / seals.FOLDER).iterdir():
            group = {line.split("  ")[1] for line in seal.read_text().splitlines() if not line.startswith("#")}
            names |= (
                {f"{seals.FOLDER}/{seal.name}", *group} if name in {*group, f"{seals.FOLDER}/{seal.name}"} else set()
            )
    for one in names:
        if (donor() / one).is_file() and (folder / one).parent.is_dir() and not (folder / one).is_dir():
            shutil.copyfile(donor() / one, folder / one, follow_symlinks=False)


def _edit(file: Path, rng: random.Random) -> None:
    """Other numbers in a sound file of its kind."""
    if file.suffix == ".npz":
        with np.load(file) as archive:
            arrays = dict(archive)
        name = rng.choice(sorted(arrays))
        if arrays[name].dtype.kind == "f" and arrays[name].size:
            arrays[name] = np.where(rng.random() < 0.5, np.nan, arrays[name] * 1.01)
        np.savez(file, **arrays)
    elif file.suffix == ".parquet":
        table = pyarrow.parquet.read_table(file)
        pyarrow.parquet.write_table(table.slice(0, max(1, table.num_rows // 2)), file)
    else:
        text = file.read_text()
        digits = [place for place, sign in enumerate(text) if sign.isdigit()]
        if digits:
            place = rng.choice(digits)
            file.write_text(text[:place] + str((int(text[place]) + 1) % 10) + text[place + 1 :])


def predictor(seed: int) -> None:
    """A predictor with arrays of other types, shapes or values, and another header: refused, or it predicts."""
    rng = random.Random(seed)
    run = reference()[0]
    file = rng.choice(sorted((run / "cells").glob("*.npz")))
    with a_place() as place, np.load(file) as archive:
        arrays: dict[str, Any] = dict(archive)
        for _ in range(rng.choice([1, 1, 2])):
            name = rng.choice(sorted(arrays))
            if name == "header" or rng.random() < 0.3:
                arrays["header"] = np.array(_other_header(str(arrays["header"]), rng))
            else:
                arrays[name] = _other_array(arrays[name], rng)
        np.savez(place / "x.npz", **arrays)
        loaded = Predictor.load(place / "x.npz")
        columns = {name: np.zeros(3) for name in ("u", "v", "r", "psi", "north", "east", "V_w", "beta_w")}
        columns |= {f"{side}.{signal}": np.ones(3) for side in ("port", "starboard") for signal in ("n", "alpha")}
        from shipid.data.windows import Instants

        loaded.predict(Instants(columns))


def _other_array(array: np.ndarray, rng: random.Random) -> np.ndarray:
    changes: list[Callable[[], np.ndarray]] = [
        lambda: array.astype(str),
        lambda: array.astype(complex) if array.dtype.kind != "U" else array,
        lambda: array[..., None],
        lambda: array.reshape(-1)[: array.size // 2],
        lambda: np.zeros((0, 3)),
        lambda: np.array(3.0),
        lambda: array > array if array.dtype.kind == "f" else array,
        lambda: array.astype(np.float16) if array.dtype.kind == "f" else array,
        lambda: array.astype(np.int8) if array.dtype.kind == "f" else array,
        lambda: array * np.nan if array.dtype.kind == "f" else array,
        lambda: np.array(["x", "y"]),
        lambda: np.array(np.datetime64("2020-01-01")),
    ]
    with np.errstate(all="ignore"):
        return rng.choice(changes)()


def _other_header(text: str, rng: random.Random) -> str:
    header = json.loads(text)
    node: Any = header
    while isinstance(node, dict | list) and node:
        key = rng.choice(list(node)) if isinstance(node, dict) else rng.randrange(len(node))
        if not isinstance(node[key], dict | list) or not node[key] or rng.random() < 0.4:
            node[key] = rng.choice([None, "x", -1, 0, 1e300, [], {}, [[1]], True, {"a": 1}, 10**400, "position"])
            break
        node = node[key]
    return json.dumps(header)


def dataset(seed: int) -> None:
    """A dataset whose metadata or columns are not what they should be: refused, or read and judged."""
    rng = random.Random(seed)
    with a_place() as place:
        table = pyarrow.parquet.read_table(reference()[0] / "dataset.parquet")
        metadata = dict(table.schema.metadata or {})
        if rng.random() < 0.6:
            key = rng.choice([b"shipid", b"pandas"])
            text = metadata[key].decode()
            values = ["[]", "null", "1", '"x"', "{", "{}", '{"flags": 3}', '{"flags": [1, []]}', '{"units": []}']
            values += [
                '{"clock": 7}',
                '{"repairs": 5}',
                '{"flags": ' + "[" * 5000 + "]" * 5000 + "}",
                text[: len(text) // 2],
            ]
            values += [
                '{"flags": ["a", "a"]}',
                '{"repairs": [1]}',
                '{"units": {"u": 3}}',
                '{"manoeuvres": 3}',
                _other_header(text, rng),
            ]
            metadata[key] = rng.choice(values).encode()
            table = table.replace_schema_metadata(metadata)
        else:
            number = rng.randrange(table.num_columns)
            field = table.schema.field(number)
            column = rng.choice(
                [
                    lambda: pyarrow.array(["x"] * table.num_rows),
                    lambda: pyarrow.array([None] * table.num_rows, "float64"),
                    lambda: pyarrow.array([[1.0]] * table.num_rows),
                    lambda: pyarrow.array([2**70] * table.num_rows, pyarrow.decimal128(38)),
                    lambda: pyarrow.array([0] * table.num_rows, "timestamp[s]"),
                    lambda: pyarrow.array([{"a": 1}] * table.num_rows),
                    lambda: pyarrow.array([1e308] * table.num_rows),
                    lambda: pyarrow.array(["x", None] * (table.num_rows // 2) + ["x"] * (table.num_rows % 2)),
                ]
            )()
            table = table.set_column(number, field.name, column)
        pyarrow.parquet.write_table(table, place / "x.parquet")
        data = read_dataset(place / "x.parquet")
        _ = (data.runs, data.commands, data.digest)
        check_dataset(data)
