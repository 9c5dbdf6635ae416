"""`prosthesis-gym bench`: how fast the vector environment steps on this machine."""

import argparse
import contextlib
import itertools
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from prosthesis_gym import _core, peers, vector_code
from prosthesis_gym.cli.parsers import Commands, new_parser
from prosthesis_gym.config import CONTROL_PERIOD_S, resolve
from prosthesis_gym.progress import progress_bar
from prosthesis_gym.rates import TURNS, median_rates
from prosthesis_gym.vector_env import ProsthesisVectorEnv

_EXAMPLES = """\
examples:
  prosthesis-gym bench
  prosthesis-gym bench --walkers 1024 --devices damper --threads 1 2 --seconds 10
  prosthesis-gym bench --peers
  prosthesis-gym bench --contended --walkers 64 1024
  prosthesis-gym bench --json > bench.json
"""
#: Action arrays that are drawn before the clock runs, then used in turn.
_DRAWS = 16
#: Env steps between two looks at the clock, at most, or one of all walkers.
_MOST_PER_CALL = 65_536
_MODES = {"agent": "direct", "state machine": "state_machine"}
#: Walkers that share blocks.
_MANY = 64


@dataclass(frozen=True)
class Setting:
    """What is measured."""

    device: str
    mode: str
    threads: int
    walkers: int

    def new_env(self) -> ProsthesisVectorEnv:
        """Return a new environment."""
        config = {"device": {"kind": self.device}, "action": {"mode": _MODES[self.mode]}}
        return ProsthesisVectorEnv(self.walkers, config=config, threads=self.threads)


@dataclass(frozen=True)
class Result(Setting):
    """Throughput of one setting, through Python."""

    env_steps_per_s: float
    simulated_s_per_s: float
    us_per_call: float
    #: Wall time x threads per walker and evaluation of the dynamics, everything included.
    ns_per_evaluation: float


def add_parser(commands: Commands) -> None:
    """Declare the command."""
    parser = new_parser(commands, "bench", "measure the speed of the vector environment with random actions", _EXAMPLES)
    sizes = [1, 64, 256, 1024, 4096, 16384, 65536]
    add = parser.add_argument
    add("--walkers", type=int, nargs="+", default=sizes, metavar="N", help=f"default: {sizes}")
    add("--devices", nargs="+", default=["damper", "motor"], metavar="KNEE", help="default: damper motor")
    add("--modes", nargs="+", choices=list(_MODES), default=["agent"], metavar="MODE", help=f"of {list(_MODES)}")
    add("--threads", type=int, nargs="+", metavar="N", help="worker threads (default: one per core)")
    add(
        "--seconds",
        type=float,
        default=2.0,
        metavar="S",
        help="time per setting (default: 2); settings take turns, all in memory",
    )
    add("--peers", action="store_true", help="also MuJoCo, Gymnasium's and EnvPool's Walker2d, as far as installed")
    add("--contended", action="store_true", help="beside a process that keeps a core busy: one thread, and all")
    add(
        "--guard",
        action="store_true",
        help="only check that the hot loops of the built library are vector code; exit code 1 if not",
    )
    add("--json", action="store_true", help="as JSON")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    if not 0.0 < arguments.seconds <= 3600.0:
        raise ValueError(f"--seconds = {arguments.seconds} must lie in (0, 3600]")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    threads = arguments.threads or ([1, cores] if arguments.contended else [cores])
    if min(threads) < 1:
        raise ValueError(f"--threads = {min(threads)} must be 1 or more")
    if arguments.guard:
        guard()
        return
    machine = {"cpu": cpu_model(), "cores": cores, "date": date.today().isoformat()}
    console = Console()
    if not arguments.json:
        console.print("{cpu}, {cores} cores, {date}".format(**machine))
        if arguments.contended:
            console.print("beside a process that keeps a core busy")
    settings = [
        Setting(*values) for values in itertools.product(arguments.devices, arguments.modes, threads, arguments.walkers)
    ]
    with busy_process() if arguments.contended else contextlib.nullcontext():
        results = measure(settings, arguments.seconds)
    memory = memory_per_walker_kib()
    peers, missing = measure_peers(arguments.seconds, max(threads)) if arguments.peers else ({}, [])
    if arguments.json:
        entries = [asdict(result) for result in results]
        print(json.dumps({"machine": machine, "results": entries, "kib_per_walker": memory, "peers": peers}, indent=2))
        return
    console.print(_table(results))
    if arguments.contended:
        for line in _gains(results):
            console.print(line)
    console.print(f"memory per walker: {memory:.1f} KiB")
    if peers:
        console.print(_peer_table(peers, max(result.env_steps_per_s for result in results)))
    for reason in missing:
        console.print(f"not measured: {reason}", markup=False)


@contextlib.contextmanager
def busy_process() -> Iterator[None]:
    """Keep a core busy as long as the context lasts."""
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as process:
        try:
            yield
        finally:
            process.kill()


def measure(settings: Sequence[Setting], seconds: float) -> list[Result]:
    """Step walkers of each setting with random actions for about `seconds`, all settings in turns."""
    with contextlib.ExitStack() as stack:
        envs = [stack.enter_context(contextlib.closing(setting.new_env())) for setting in settings]
        turns = TURNS * len(settings)
        show = stack.enter_context(progress_bar("measuring", turns, "turns"))
        rates = median_rates([stepping(env) for env in envs], seconds, show)
    return [_result(*each) for each in zip(settings, envs, rates, strict=True)]


def stepping(env: ProsthesisVectorEnv) -> Callable[[], int]:
    """Return a function that takes some steps with random actions, and returns how many env steps that were."""
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (_DRAWS, env.num_envs, 1)).astype(np.float32)
    turn = itertools.cycle(actions)
    steps = min(_DRAWS, max(1, _MOST_PER_CALL // env.num_envs))
    env.reset(seed=0)

    def step() -> int:
        for action in itertools.islice(turn, steps):
            env.step(action)
        return steps * env.num_envs

    return step


def _result(setting: Setting, env: ProsthesisVectorEnv, rate: float) -> Result:
    stages = {"two_stage_w": 2, "rk4": 4}.get(env.config["solver"]["stepper"], 1)
    per_evaluation = 1e9 * setting.threads / (rate * (env.batch.solver_steps * stages + 1))
    us_per_call = 1e6 * setting.walkers / rate
    return Result(
        **asdict(setting),
        env_steps_per_s=rate,
        simulated_s_per_s=rate * CONTROL_PERIOD_S,
        us_per_call=us_per_call,
        ns_per_evaluation=per_evaluation,
    )


def memory_per_walker_kib() -> float:
    """Memory of a walker in its block."""
    return float(_core.Batch(_MANY, resolve({}), autoreset="next_step").bytes_per_walker) / 1024.0


def guard() -> None:
    """Print what share of the hot functions' arithmetic is vector code, and raise unless it is enough."""
    listed = vector_code.shares(Path(_core.__file__))
    table = Table("vector unit", "body", "functions", "instructions", "packed", box=box.SIMPLE_HEAD)
    for (unit, body), group in itertools.groupby(listed, key=lambda share: (share.unit, share.body)):
        whole, *functions = group
        name = "::".join(body.split("::")[-2:])
        table.add_row(unit, name, str(len(functions)), f"{whole.instructions:,}", f"{whole.share:.0%}")
    Console().print(table)
    faults = [share.fault for share in listed if share.fault is not None]
    if faults:
        raise SystemExit("\n".join(faults))


def measure_peers(seconds: float, threads: int) -> tuple[dict[str, float], list[str]]:
    """Return env steps per second of other simulators, and why some were not measured."""
    rates: dict[str, float] = {}
    missing: list[str] = []
    simulators: dict[str, Callable[[], float]] = {
        "MuJoCo rollout, the same mechanism, 0.5 ms": lambda: peers.mujoco_rollout(seconds, threads),
        "Gymnasium Walker2d-v5, one environment": lambda: peers.gymnasium_walker2d(seconds),
        "EnvPool Walker2d-v4": lambda: peers.envpool_walker2d(seconds, threads),
    }
    for name, rate in simulators.items():
        try:
            rates[name] = rate()
        except ModuleNotFoundError as error:
            missing.append(f"{name}: {error}")
    with contextlib.suppress(ModuleNotFoundError):
        step_s = peers.mujoco_step_of(peers.STEADY_ERROR)
        name = f"the same at our steady error of {peers.STEADY_ERROR:.2%}, {1e3 * step_s:g} ms"
        rates[name] = peers.mujoco_rollout(seconds, threads, step_s)
    return rates, missing


def _table(results: list[Result]) -> Table:
    headers = (
        "knee",
        "actions",
        "walkers",
        "threads",
        "env\nsteps/s",
        "simulated\ns/s",
        "µs per\ncall",
        "ns per\nevaluation",
    )
    table = Table(*headers, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in table.columns[2:]:
        column.justify, column.no_wrap = "right", True
    for r in results:
        counts = (f"{r.walkers:,}", str(r.threads), f"{r.env_steps_per_s:,.0f}", f"{r.simulated_s_per_s:,.0f}")
        table.add_row(r.device, r.mode, *counts, f"{r.us_per_call:,.1f}", f"{r.ns_per_evaluation:.1f}")
    return table


def _gains(results: list[Result]) -> Iterator[str]:
    """Say how much faster than one thread several are, by knee, actions and walkers."""
    single = {(r.device, r.mode, r.walkers): r.env_steps_per_s for r in results if r.threads == 1}
    for r in results:
        alone = single.get((r.device, r.mode, r.walkers))
        if r.threads > 1 and alone is not None:
            ratio = r.env_steps_per_s / alone
            setting = f"{r.device}, {r.mode}, {r.walkers:,} walkers"
            yield f"{setting}: {r.threads} threads make {ratio:.2f} times the steps of one"


def _peer_table(rates: dict[str, float], ours: float) -> Table:
    table = Table("peer", "env steps/s", "ours is faster by", box=box.SIMPLE_HEAD)
    for name, rate in rates.items():
        table.add_row(name, f"{rate:,.0f}", f"{ours / rate:,.0f} times")
    return table


def cpu_model() -> str:
    """Name of the processor, as far as the system tells."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
