"""`prosthesis-gym bench`: how fast the vector environment steps on this machine."""

import argparse
import json
import os
import platform
import time
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from prosthesis_gym.cli.parsers import Commands, new_parser
from prosthesis_gym.vector_env import CONTROL_PERIOD_S, ProsthesisVectorEnv

_EXAMPLES = """\
examples:
  prosthesis-gym bench
  prosthesis-gym bench --walkers 1024 --threads 1 --seconds 10
  prosthesis-gym bench --json > bench.json
"""
#: Action arrays that are drawn before the clock runs and then used in turn.
_DRAWS = 64


@dataclass(frozen=True)
class Result:
    """Throughput at one batch size, through Python."""

    walkers: int
    steps_per_s: float
    simulated_s_per_s: float
    us_per_call: float


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = new_parser(commands, "bench", "measure the speed of the vector environment with random actions", _EXAMPLES)
    sizes = [1, 64, 1024, 4096]
    parser.add_argument("--walkers", type=int, nargs="+", default=sizes, metavar="N", help=f"default: {sizes}")
    parser.add_argument("--threads", type=int, metavar="N", help="worker threads (default: one per core)")
    parser.add_argument("--seconds", type=float, default=3.0, metavar="S", help="time per batch size (default: 3)")
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    if not 0.0 < arguments.seconds <= 3600.0:
        raise ValueError(f"--seconds = {arguments.seconds} must lie in (0, 3600]")
    if arguments.threads is not None and arguments.threads < 1:
        raise ValueError(f"--threads = {arguments.threads} must be 1 or more")
    machine = {
        "cpu": cpu_model(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "threads": arguments.threads or "one per core",
        "date": date.today().isoformat(),
    }
    if not arguments.json:
        print("{cpu}, {cores} cores, threads: {threads}, {date}".format(**machine))
    results = [measure(walkers, arguments.threads, arguments.seconds) for walkers in arguments.walkers]
    if arguments.json:
        print(json.dumps({"machine": machine, "results": [asdict(result) for result in results]}, indent=2))
        return
    table = Table("walkers", "env steps/s", "simulated s/s", "µs per call", box=box.SIMPLE_HEAD)
    for column in table.columns:
        column.justify = "right"
    for result in results:
        table.add_row(
            f"{result.walkers:,}",
            f"{result.steps_per_s:,.0f}",
            f"{result.simulated_s_per_s:,.0f}",
            f"{result.us_per_call:,.1f}",
        )
    Console().print(table)


def measure(walkers: int, threads: int | None, seconds: float) -> Result:
    """Step `walkers` walkers with random actions for about `seconds`."""
    env = ProsthesisVectorEnv(walkers, threads=threads)
    env.reset(seed=0)
    random = np.random.default_rng(0)
    actions = random.uniform(-1.0, 1.0, (_DRAWS, walkers, 1)).astype(np.float32)
    for action in actions:  # wakes the thread pool and mixes the phases of the walkers
        env.step(action)
    calls, began = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - began) < seconds:
        for action in actions:
            env.step(action)
        calls += _DRAWS
    env.close()
    steps_per_s = calls * walkers / elapsed
    hold = env.config["action"]["hold"]
    return Result(walkers, steps_per_s, steps_per_s * hold * CONTROL_PERIOD_S, 1e6 * elapsed / calls)


def cpu_model() -> str:
    """Name of the processor, as far as the system tells."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
