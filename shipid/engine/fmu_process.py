"""The process in which an FMU runs, and how its runs are asked for: one that hangs or ends takes nothing with it.

FMPy calls the FMU, `pip install 'shipid[fmu]'`. What an FMU prints goes to a file; the last line is part of its fault.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe
from pathlib import Path

from shipid.errors import escape_unprintable

Rows = list[list[float]]
MOST_ENDS = 3  # how often an FMU may hang or end its process before its other runs are given up
TO_LOAD = 60.0  # s that loading an FMU may take
LOG = 1  # file into which the process of an FMU prints
LAST_LINE = 200  # characters of what it printed that a fault quotes


@dataclass(frozen=True)
class FmuCall:
    """How an FMU is called: value references of its variables, and its steps.

    before, values : what is set before it is initialised, the same in every run, and its values. start, inputs,
        outputs : what else is set then; what is set before each step; what is read. step : of communication [s].
    every : steps between two records.
    """

    before: Sequence[int]
    values: Sequence[float]
    start: Sequence[int]
    inputs: Sequence[int]
    outputs: Sequence[int]
    step: float
    every: int


@dataclass(frozen=True)
class FmuRun:
    """A run of an FMU: from its start, or on from where the last one branched off.

    start : values; None: the last run goes on. advance, branch : inputs of each step until records begin, and while
        they are kept. returns : whether the FMU returns to where the records began, for the next run.
    """

    start: Sequence[float] | None
    advance: Rows
    branch: Rows
    returns: bool = False


def run_fmu(folder: Path, call: FmuCall, runs: Sequence[FmuRun], limit: float) -> Iterator[tuple[Rows, str]]:
    """Records of the outputs of each run, from its branch on, and its fault: the records end there; empty: none.

    folder : of the unpacked FMU. limit : [s] that a run may take.
    """
    left, ends, fault = list(runs), 0, ""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    while left and ends < MOST_ENDS:
        (here, there), allowed = Pipe(), TO_LOAD
        command = [sys.executable, "-uP", "-m", "shipid.engine.fmu_process", str(there.fileno()), str(folder)]
        with tempfile.TemporaryFile() as log, here:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                pass_fds=[there.fileno()],
                cwd=folder,
                env=environment,
            )
            there.close()
            try:
                here.send((call, left))
                while left and here.poll(allowed):
                    rows, fault = here.recv()
                    if rows is not None:  # else it is loaded now
                        yield rows, fault
                        del left[0]
                    allowed = limit
                fault = f"takes longer than {allowed:g} s"
            except (EOFError, OSError):
                fault = "ends its process"
            finally:
                process.kill()
                process.wait()
            if left:
                fault += _last_line(log.fileno())
                yield [], fault
                del left[0]
                ends += 1
    yield from (([], fault) for _ in left)


def _last_line(log: int) -> str:
    """The last line that the FMU printed into a file, in brackets."""
    end = os.fstat(log).st_size
    lines = os.pread(log, LAST_LINE, max(end - LAST_LINE, 0)).decode(errors="replace").split("\n")
    return next((f" ({escape_unprintable(line.strip())})" for line in reversed(lines) if line.strip()), "")


class FmuInstance:
    """One instance of an FMU, used again for every run."""

    def __init__(self, folder: str, call: FmuCall):
        import fmpy

        self.description = fmpy.read_model_description(folder, validate=False)
        self.folder, self.call, self.version = folder, call, self.description.fmiVersion[0]
        self.renew()

    def renew(self) -> None:
        """Take a new instance."""
        from fmpy.simulation import instantiate_fmu

        # with its log: the last line says why it fails
        self.fmu = instantiate_fmu(self.folder, self.description, "CoSimulation", debug_logging=True)
        self.used, self.time = False, 0.0
        real = "Float64" if self.version == "3" else "Real"
        self.get, self.set = getattr(self.fmu, f"get{real}"), getattr(self.fmu, f"set{real}")

    def begin(self, start: Sequence[float], first: Sequence[float]) -> None:
        """Initialise anew with these start values and first inputs."""
        call = self.call
        try:
            if self.used:
                self.fmu.reset()
        except Exception:  # after a fatal fault, or of an FMU that has no reset
            self.renew()
        self.used, self.time = True, 0.0
        if self.version == "2":
            self.fmu.setupExperiment(startTime=0.0)
        self.set([*call.before, *call.start, *call.inputs], [*call.values, *start, *first])
        if self.version == "1":
            self.fmu.initialize()
        else:
            self.fmu.enterInitializationMode()
            self.fmu.exitInitializationMode()

    def step(self, inputs: Sequence[float]) -> None:
        """Do a step with these inputs; RuntimeError where the FMU ends the simulation."""
        self.set(self.call.inputs, inputs)
        ended = self.fmu.doStep(self.time, self.call.step)
        if self.version == "3" and (ended[1] or ended[2]):
            raise RuntimeError("the FMU ends the simulation")
        self.time += self.call.step

    def run(self, run: FmuRun, rows: Rows) -> None:
        """Fill in the records of a run."""
        if run.start is not None:
            self.begin(run.start, (run.advance or run.branch)[0])
        for inputs in run.advance:
            self.step(inputs)
        kept, time = self.fmu.getFMUState() if run.returns else None, self.time
        rows.append(self.get(self.call.outputs))
        for place, inputs in enumerate(run.branch, 1):
            self.step(inputs)
            if place % self.call.every == 0:
                rows.append(self.get(self.call.outputs))
        if kept is not None:
            self.fmu.setFMUState(kept)
            self.fmu.freeFMUState(kept)
            self.time = time


def _serve(connection: Connection, folder: str) -> None:
    """Answer one request: nothing once the FMU is loaded, then the records and the fault of each run."""
    call, runs = connection.recv()
    one, fault = FmuInstance(folder, call), ""
    connection.send((None, ""))
    for run in runs:
        rows: Rows = []
        os.ftruncate(LOG, os.lseek(LOG, 0, os.SEEK_SET))
        try:
            if run.start is not None or not fault:  # else what it goes on from has failed
                fault = ""
                one.run(run, rows)
        except Exception as error:
            fault = f"{error} at {one.time:g} s{_last_line(LOG)}"
        connection.send((rows, fault))


if __name__ == "__main__":
    _serve(Connection(int(sys.argv[1])), sys.argv[2])  # open until an error is printed
