"""Tasks in C on threads: generated C defines one task, Python names its inputs, and one call of C does many tasks."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from shipid.engine.integrate import count_threads

STACK = 8 << 20  # bytes of a thread
AT_ONCE = 2_000_000  # units of work in one call of C, a fraction of a second: an interrupt waits for its end


def threaded_source(sizes: Iterable[str], arrays: Mapping[str, str], task: str) -> str:
    """C function `run`: tasks `next` to `end` on threads, each taken by the first that is free; see `run_tasks`.

    sizes : names of whole numbers. arrays : name -> C type of an entry. task : C statements of the task `number`, which
    know these names.
    """
    known = [f"const long {name} = work->sizes[{i}];" for i, name in enumerate(sizes)]
    known += [f"{kind} *{name} = work->arrays[{i}];" for i, (name, kind) in enumerate(arrays.items())]
    return f"""
#include <pthread.h>
typedef struct {{ long next, end; const long *sizes; void *const *arrays; }} Work;
static void task(const Work *work, const long number) {{
{" ".join(known)}
{task} }}
static void *drain(void *given) {{
  Work *work = given;
  for (long i; (i = __atomic_fetch_add(&work->next, 1, __ATOMIC_RELAXED)) < work->end;) task(work, i);
  return 0;
}}
void run(long next, long end, long threads, const long *sizes, void *const *arrays) {{
  Work work = {{next, end, sizes, arrays}};
  pthread_t helpers[threads];
  pthread_attr_t settings;
  long begun = 0;
  pthread_attr_init(&settings);
  pthread_attr_setstacksize(&settings, {STACK});
  while (begun < threads - 1 && !pthread_create(helpers + begun, &settings, drain, &work)) ++begun;
  drain(&work);
  while (begun) pthread_join(helpers[--begun], 0);
  pthread_attr_destroy(&settings);
}}
"""


def run_tasks(run: Any, sizes: Iterable[int], arrays: Iterable[np.ndarray | None], num_tasks: int, work: float) -> None:
    """Do all tasks of a C function of `threaded_source`, on as many threads as cores, some in one call.

    After an interrupt no further call is made. sizes, arrays : as of `threaded_source`; None is a null pointer.
    work : of one task, in units of a tenth of a microsecond or so.
    """
    held, threads = list(arrays), count_threads()
    # as `array.ctypes.data`, in a quarter of the time
    pointers = [None if array is None else array.__array_interface__["data"][0] for array in held]
    numbers = list(sizes)
    inputs = (ctypes.c_long * len(numbers))(*numbers), (ctypes.c_void_p * len(held))(*pointers)
    few = max(2 * threads, int(AT_ONCE // max(work, 1.0)))
    for first in range(0, num_tasks, few):
        end = min(first + few, num_tasks)
        run(ctypes.c_long(first), ctypes.c_long(end), ctypes.c_long(min(threads, end - first)), *inputs)
