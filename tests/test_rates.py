"""Rates of settings that take turns."""

import time
from collections.abc import Callable

import pytest

from prosthesis_gym.rates import TURNS, median_rates


class Clock:
    """A clock that only work moves on."""

    def __init__(self) -> None:
        self.now = 100.0

    def work(self, seconds: float, amount: int) -> Callable[[], int]:
        def do() -> int:
            self.now += seconds
            return amount

        return do


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(time, "perf_counter", lambda: clock.now)
    return clock


def test_rate_is_work_over_time(clock: Clock) -> None:
    settings = [clock.work(0.01, 5), clock.work(0.02, 5), clock.work(10.0, 7)]
    assert median_rates(settings, 1.1) == pytest.approx([500.0, 250.0, 0.7])


def test_settings_take_turns(clock: Clock) -> None:
    order: list[str] = []

    def setting(name: str) -> Callable[[], int]:
        step = clock.work(1.0, 1)

        def work() -> int:
            order.append(name)
            return step()

        return work

    done: list[float] = []
    median_rates([setting("a"), setting("b")], float(TURNS), done.append)
    assert order == ["a", "a", "b", "b", *["a", "b"] * TURNS]
    assert done == list(range(1, 2 * TURNS + 1))


def test_a_disturbance_in_less_than_half_of_the_turns_changes_nothing(clock: Clock) -> None:
    calls = 0

    def work() -> int:
        nonlocal calls
        calls += 1
        clock.now += 50.0 if calls % 3 == 0 else 1.0
        return 10

    assert median_rates([work], float(TURNS)) == pytest.approx([10.0])
