"""RLlib learns on the native vector environment itself, through its setting for environments that come vectorised."""

from collections.abc import Iterator

import gymnasium
import numpy as np
import pytest

pytest.importorskip("ray.rllib", reason="RLlib is not installed: pip install 'prosthesis-gym[rllib]'")

import ray
from gymnasium.vector import AutoresetMode
from ray.rllib.algorithms.ppo import PPOConfig

from prosthesis_gym import ProsthesisVectorEnv

# RLlib warns of its own plans and leaves sockets to the garbage collector.
pytestmark = [pytest.mark.timeout(300), pytest.mark.filterwarnings("ignore")]
WALKERS, BATCH, ITERATIONS = 32, 2048, 4


@pytest.fixture(scope="module", autouse=True)
def cluster() -> Iterator[None]:
    ray.init(num_cpus=1, include_dashboard=False, logging_level="ERROR")
    yield
    ray.shutdown()


def test_ppo_trains_on_the_native_vector_env(env_id: str) -> None:
    scenario = {"duration_s": 3.0, "push_n": 400.0, "push_s": [0.5, 2.0]}
    config = (
        PPOConfig()
        .environment(
            f"prosthesis_gym:{env_id}",
            env_config={"config": {"action": {"hold": 4}, "scenario": scenario}, "threads": 1},
        )
        .env_runners(
            num_env_runners=0,
            num_envs_per_env_runner=WALKERS,
            gym_env_vectorize_mode=gymnasium.VectorizeMode.VECTOR_ENTRY_POINT,
        )
        .training(train_batch_size_per_learner=BATCH, minibatch_size=512, num_epochs=2, lr=3e-4, gamma=0.99)
        .debugging(seed=0)
    )
    algorithm = config.build_algo()
    try:
        envs = algorithm.env_runner.env.unwrapped
        assert isinstance(envs, ProsthesisVectorEnv)
        assert envs.num_envs == WALKERS
        assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
        weights = algorithm.get_module().get_state()
        results = [algorithm.train() for _ in range(ITERATIONS)]
        learned = algorithm.get_module().get_state()
    finally:
        algorithm.stop()
    assert sum(result["env_runners"]["num_env_steps_sampled"] for result in results) >= ITERATIONS * BATCH
    assert sum(result["env_runners"].get("num_episodes", 0) for result in results) >= WALKERS
    # 3 s are 150 steps; RLlib counts one more for each batch that an episode reaches over (Pendulum's 200 become 202).
    assert results[-1]["env_runners"]["episode_len_max"] <= 150 + ITERATIONS
    assert np.isfinite(results[-1]["env_runners"]["episode_return_mean"])
    assert any((weights[name] != learned[name]).any() for name in weights)


def test_rllib_trains_on_single_environments() -> None:
    """Without the setting, RLlib vectorises single environments itself."""
    config = (
        PPOConfig()
        .environment("prosthesis_gym:prosthesis_gym/DamperKnee-v0")
        .env_runners(num_env_runners=0, num_envs_per_env_runner=2)
        .training(train_batch_size_per_learner=128, minibatch_size=64, num_epochs=1)
    )
    algorithm = config.build_algo()
    try:
        assert isinstance(algorithm.env_runner.env.unwrapped, gymnasium.vector.SyncVectorEnv)
        assert algorithm.train()["env_runners"]["num_env_steps_sampled"] >= 128
    finally:
        algorithm.stop()
