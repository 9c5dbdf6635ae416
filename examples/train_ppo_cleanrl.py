"""PPO in one file on the native vector environment, after CleanRL: a knee damper learns to correct its state machine.

    python examples/train_ppo_cleanrl.py --steps 4000000

Prints every 500,000 env steps how many of the episodes that ended meanwhile were falls, and the mean return of the
last thousand. Nobody can have walked a whole episode (600 steps) by the first line, so that it counts falls alone. The
state machine by itself falls in 31 % of the episodes.
"""

import argparse
import math
import time
from collections.abc import Sequence

import gymnasium
import numpy as np
import torch
from gymnasium.wrappers.vector import ClipReward, NormalizeObservation, RecordEpisodeStatistics
from rich.progress import Progress
from torch import Tensor, nn
from torch.distributions import Normal

from prosthesis_gym.console import clean_exit, spell_what_cannot_be_encoded
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.seeding import run_seed

CONFIG = {
    "action": {"mode": "residual", "hold": 4, "residual_nms2_rad2": 20.0},
    "observation": {"frames": 8},
    "reward": {"fall": -20.0, "end_stop": -8.0, "energy": -0.3, "smoothness": -0.1},
}
ROLLOUT_STEPS, EPOCHS, MINIBATCH = 32, 5, 8192
GAMMA, GAE_LAMBDA, CLIP, VALUE_WEIGHT, GRADIENT_NORM = 0.995, 0.95, 0.2, 0.5, 0.5
LEARNING_RATE, FIRST_LOG_STD = 5e-4, -0.7


def network(inputs: int, output_gain: float) -> nn.Sequential:
    """Two hidden layers of 64, with orthogonal weights."""
    net = nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 1))
    for index, gain in ((0, 2**0.5), (2, 2**0.5), (4, output_gain)):
        nn.init.orthogonal_(net[index].weight, gain)
        nn.init.zeros_(net[index].bias)
    return net


class Agent(nn.Module):
    """Gaussian policy and value of observations (N, D)."""

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self.actor, self.critic = network(inputs, 0.01), network(inputs, 1.0)
        self.log_std = nn.Parameter(torch.full((1,), FIRST_LOG_STD))

    def policy(self, observations: Tensor) -> Normal:
        """Distribution of the actions (N, 1)."""
        return Normal(self.actor(observations), self.log_std.exp())

    def value(self, observations: Tensor) -> Tensor:
        """Values (N,)."""
        return self.critic(observations)[:, 0]


def advantages_of(rewards: Tensor, values: Tensor, terminated: Tensor, done: Tensor) -> Tensor:
    """Generalised advantages (T, N), from rewards, flags (T, N) and values (T + 1, N).

    An episode that ends in step t leaves its last observation in t + 1 (autoreset in the next step): the value of a
    truncated episode goes on from there, and nothing else crosses an end.
    """
    advantages, last = torch.zeros_like(rewards), torch.zeros(rewards.shape[1])
    for t in reversed(range(len(rewards))):
        delta = rewards[t] + GAMMA * values[t + 1] * ~terminated[t] - values[t]
        advantages[t] = last = delta + GAMMA * GAE_LAMBDA * ~done[t] * last
    return advantages


def update(agent: Agent, optimizer: torch.optim.Optimizer, rollout: tuple[Tensor, ...]) -> None:
    """Improve the agent by a rollout of observations, actions, log-probabilities, advantages and returns (M, ...)."""
    for _ in range(EPOCHS):
        for rows in torch.randperm(len(rollout[0])).split(MINIBATCH):
            observations, actions, log_probabilities, advantages, returns = (part[rows] for part in rollout)
            advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
            ratio = (agent.policy(observations).log_prob(actions)[:, 0] - log_probabilities).exp()
            gain = torch.min(advantages * ratio, advantages * ratio.clamp(1 - CLIP, 1 + CLIP)).mean()
            value_loss = 0.5 * (agent.value(observations) - returns).square().mean()
            optimizer.zero_grad()
            (VALUE_WEIGHT * value_loss - gain).backward()
            nn.utils.clip_grad_norm_(agent.parameters(), GRADIENT_NORM)
            optimizer.step()


def train(env_id: str, total_steps: int, walkers: int, report_every: int, seed: int) -> None:
    """Train and print as it goes."""
    torch.manual_seed(seed)
    # Networks this small gain little from a second thread, and lose much where the cores are shared.
    torch.set_num_threads(1)
    native = gymnasium.make_vec(env_id, num_envs=walkers, config=CONFIG)
    statistics = RecordEpisodeStatistics(native, buffer_length=walkers)
    envs = NormalizeObservation(ClipReward(statistics, -25.0, 25.0))
    size = envs.single_observation_space.shape[0]
    agent = Agent(size)
    optimizer = torch.optim.Adam(agent.parameters(), lr=LEARNING_RATE, eps=1e-5)

    shape = (ROLLOUT_STEPS, walkers)
    observations, actions = torch.zeros(ROLLOUT_STEPS + 1, walkers, size), torch.zeros(*shape, 1)
    log_probabilities, rewards = torch.zeros(shape), torch.zeros(shape)
    terminated, done = torch.zeros(shape, dtype=torch.bool), torch.zeros(shape, dtype=torch.bool)
    observations[-1] = torch.from_numpy(envs.reset(seed=run_seed(seed))[0]).clamp(-10.0, 10.0)
    episodes = falls = 0
    began = time.perf_counter()
    with Progress() as bar:
        task = bar.add_task("training", total=total_steps)
        for iteration in range(1, math.ceil(total_steps / (ROLLOUT_STEPS * walkers)) + 1):
            steps = iteration * ROLLOUT_STEPS * walkers
            optimizer.param_groups[0]["lr"] = LEARNING_RATE * max(0.05, 1.0 - steps / total_steps)
            # A step after an end only resets, whatever the action: it is not learned from.
            acted = torch.ones(shape, dtype=torch.bool)
            acted[0] = ~done[-1]
            observations[0] = observations[-1]
            with torch.no_grad():
                for t in range(ROLLOUT_STEPS):
                    policy = agent.policy(observations[t])
                    actions[t] = policy.sample()
                    log_probabilities[t] = policy.log_prob(actions[t])[:, 0]
                    after, reward, fell, timed_out, _ = envs.step(actions[t].numpy())
                    observations[t + 1] = torch.from_numpy(after).clamp(-10.0, 10.0)
                    rewards[t], terminated[t] = torch.from_numpy(reward), torch.from_numpy(fell)
                    done[t] = torch.from_numpy(fell | timed_out)
                    falls, episodes = falls + int(fell.sum()), episodes + int(done[t].sum())
                acted[1:] = ~done[:-1]
                values = agent.value(observations.flatten(0, 1)).view(ROLLOUT_STEPS + 1, walkers)
                advantages = advantages_of(rewards, values, terminated, done)
            parts = (observations[:-1], actions, log_probabilities, advantages, advantages + values[:-1])
            update(agent, optimizer, tuple(part[acted] for part in parts))
            bar.update(task, completed=steps)
            if episodes and steps // report_every > (steps - ROLLOUT_STEPS * walkers) // report_every:
                done_by = f"{steps:>11,} steps, {time.perf_counter() - began:4.0f} s"
                line = f"{done_by}: {falls / episodes:6.1%} of {episodes:,} episodes fell"
                bar.console.print(f"{line}, mean return {np.mean(statistics.return_queue):7.2f}", highlight=False)
                episodes = falls = 0
    envs.close()


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    spell_what_cannot_be_encoded()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env", default="prosthesis_gym/DamperKnee-v0", metavar="ID", help="default: %(default)s")
    parser.add_argument("--steps", type=int, default=4_000_000, metavar="N", help="env steps (default: %(default)s)")
    parser.add_argument("--walkers", type=int, default=1024, metavar="N", help="default: %(default)s")
    parser.add_argument("--report-every", type=int, default=500_000, metavar="N", help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="default: %(default)s")
    options = parser.parse_args(arguments)
    with clean_exit(parser):
        for name in ("steps", "walkers", "report_every"):
            if getattr(options, name) < 1:
                raise ValueError(f"--{name.replace('_', '-')} = {getattr(options, name)} must be at least 1")
        if options.seed < 0:
            raise ValueError(f"--seed = {options.seed} must be 0 or more")
        if options.env not in gymnasium.registry:
            known = ", ".join(device.env_id for device in DEVICES.values())
            raise ValueError(f"--env = {options.env!r} must be one of {known}")
        train(options.env, options.steps, options.walkers, options.report_every, options.seed)


if __name__ == "__main__":
    main()
