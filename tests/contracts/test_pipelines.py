"""Rollouts past the ends of episodes in the pipelines of others, which turn infos into tensors or stack them.

`.ci/contracts` installs the libraries; where one is missing, its tests are skipped.
"""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers import NumpyToTorch
from gymnasium.wrappers.vector import NumpyToTorch as VectorNumpyToTorch

from prosthesis_gym import ProsthesisVectorEnv, TerminationReason
from prosthesis_gym.sb3 import ProsthesisVecEnv, ProsthesisVecNormalize

torch = pytest.importorskip("torch")

# What other packages warn of is not ours to mend.
pytestmark = [pytest.mark.timeout(300), pytest.mark.filterwarnings("ignore")]
WALKERS, LENGTH, STEPS = 3, 40, 130
#: Nobody falls so soon: all ends are those of time.
CONFIG: dict[str, Any] = {"scenario": {"push_n": 0.0, "start": "standing"}}


def single(env_id: str) -> gymnasium.Env[Any, Any]:
    return gymnasium.make(env_id, config=CONFIG, max_episode_steps=LENGTH)


def sync(env_id: str, mode: AutoresetMode) -> VectorEnv[Any, Any, Any]:
    return SyncVectorEnv([lambda: single(env_id)] * WALKERS, autoreset_mode=mode)


def native(env_id: str, mode: AutoresetMode) -> VectorEnv[Any, Any, Any]:
    return gymnasium.make_vec(env_id, WALKERS, config=CONFIG, max_episode_steps=LENGTH, autoreset_mode=mode)


# Gymnasium's SyncVectorEnv puts final observations into an array of objects, which NumpyToTorch refuses, whatever the
# environment: that pair alone is not here.
KINDS = [(native, mode) for mode in AutoresetMode] + [
    (sync, mode) for mode in (AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED)
]


@pytest.mark.parametrize(("make", "mode"), KINDS)
def test_numpy_to_torch_gives_tensors_in_every_step_of_a_batch(env_id: str, make: Any, mode: AutoresetMode) -> None:  # noqa: ANN401
    envs: Any = VectorNumpyToTorch(make(env_id, mode))
    envs.reset(seed=0)
    ends = 0
    for _ in range(STEPS):
        *_, terminated, truncated, infos = envs.step(torch.zeros(WALKERS, 1))
        ended = terminated | truncated
        final = infos.get("final_info", infos)
        for info in (infos, final):
            for key, value in info.items():
                assert isinstance(value, dict if key == "final_info" else torch.Tensor), key
        if "termination_reason" in final:  # SyncVectorEnv leaves out what none has
            reasons = final["termination_reason"]
            assert reasons.tolist() == (TerminationReason.TIME_LIMIT * ended).tolist()
        if ended.any() and mode == AutoresetMode.SAME_STEP:
            assert infos["final_obs"].shape == (WALKERS, *envs.single_observation_space.shape)
        if ended.any() and mode == AutoresetMode.DISABLED:
            envs.env.reset(options={"reset_mask": ended.numpy()})
        ends += int(ended.sum())
    assert ends == 3 * WALKERS


def test_numpy_to_torch_gives_tensors_in_every_step_of_one_walker(env_id: str) -> None:
    env: Any = NumpyToTorch(single(env_id))
    env.reset(seed=0)
    for step in range(1, LENGTH + 1):
        *_, truncated, info = env.step(torch.zeros(1))
        assert truncated == (step == LENGTH)
        assert all(isinstance(value, torch.Tensor) and value.ndim == 0 for value in info.values())
        assert info["termination_reason"] == (TerminationReason.TIME_LIMIT if truncated else TerminationReason.NONE)


@pytest.mark.parametrize("make", [sync, native])
@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.DISABLED])
def test_torchrl_rolls_batches_out(env_id: str, make: Any, mode: AutoresetMode) -> None:  # noqa: ANN401
    gym = pytest.importorskip("torchrl.envs.libs.gym", reason="TorchRL is not installed")
    env = gym.GymWrapper(make(env_id, mode))
    env.set_seed(0)
    rollout = env.rollout(STEPS, break_when_any_done=False)
    steps = rollout["next"]
    assert steps.batch_size == (WALKERS, STEPS)
    done = steps["done"][..., 0]
    assert done.sum() == 3 * WALKERS
    assert done[:, LENGTH - 1].all()
    # The observation after a step that ends an episode is its last one, not the first of the next.
    plain = native(env_id, AutoresetMode.DISABLED)
    plain.reset(seed=0)
    plain.reset()  # as the rollout does once more
    for step in range(LENGTH):
        last = plain.step(rollout["action"][:, step].numpy())[0]
    np.testing.assert_array_equal(steps["observation"][:, LENGTH - 1].numpy(), last)


def test_torchrl_reads_the_infos_of_one_walker(env_id: str) -> None:
    gym = pytest.importorskip("torchrl.envs.libs.gym", reason="TorchRL is not installed")
    env = gym.GymWrapper(single(env_id)).auto_register_info_dict()
    steps = env.rollout(STEPS, break_when_any_done=False)["next"]
    reasons, done = steps["termination_reason"], steps["done"][:, 0]
    assert done.sum() == 3
    assert reasons.tolist() == (TerminationReason.TIME_LIMIT * done).tolist()
    assert (steps["reward_alive"] > 0.0).all()


def test_tianshou_collects_past_ends(env_id: str) -> None:
    data = pytest.importorskip("tianshou.data", reason="Tianshou is not installed")
    from tianshou.algorithm.algorithm_base import Policy  # noqa: PLC0415 - only where it is installed
    from tianshou.env import DummyVectorEnv  # noqa: PLC0415

    class Still(Policy):  # type: ignore[misc] # which type is unknown
        def forward(self, batch: Any, state: Any = None, **_: Any) -> Any:  # noqa: ANN401
            return data.Batch(act=np.zeros((len(batch.obs), 1), dtype=np.float32), state=state)

    envs = DummyVectorEnv([lambda: single(env_id)] * WALKERS)
    policy = Still(action_space=envs.action_space[0], observation_space=envs.observation_space[0])
    buffer = data.VectorReplayBuffer(WALKERS * STEPS, WALKERS)
    collector = data.Collector(policy, envs, buffer)
    collector.reset()
    collected = collector.collect(n_step=WALKERS * STEPS)
    assert collected.n_collected_episodes == 3 * WALKERS
    assert set(collected.lens) == {LENGTH}
    reasons = buffer.info.termination_reason[buffer.done]
    assert reasons.tolist() == [TerminationReason.TIME_LIMIT] * (3 * WALKERS)


@pytest.mark.parametrize("count", [None, WALKERS])
def test_skrl_wraps_and_steps(env_id: str, count: int | None) -> None:
    wrappers = pytest.importorskip("skrl.envs.wrappers.torch", reason="skrl is not installed")
    env = wrappers.wrap_env(single(env_id) if count is None else native(env_id, AutoresetMode.NEXT_STEP))
    assert env.num_envs == (count or 1)
    env.reset()
    ends = 0
    for _ in range(STEPS):
        observations, rewards, terminated, truncated, _ = env.step(torch.zeros(env.num_envs, 1))
        assert observations.shape[0] == rewards.shape[0] == env.num_envs
        assert not terminated.any()
        ends += int(truncated.sum())
        if count is None and truncated.any():
            env.reset()
    assert ends == 3 * env.num_envs
    env.close()


@pytest.mark.parametrize("wrapped", [False, True])
def test_sb3_contrib_learns_recurrently_and_off_policy(wrapped: bool) -> None:
    contrib = pytest.importorskip("sb3_contrib", reason="sb3-contrib is not installed")
    torch.set_num_threads(1)

    def walkers() -> Any:  # noqa: ANN401
        env = ProsthesisVecEnv(WALKERS, CONFIG, max_episode_steps=LENGTH)
        return ProsthesisVecNormalize(env) if wrapped else env

    recurrent = contrib.RecurrentPPO("MlpLstmPolicy", walkers(), n_steps=64, batch_size=64, n_epochs=1, device="cpu")
    recurrent.learn(2 * 64 * WALKERS)
    assert {int(info["l"]) for info in recurrent.ep_info_buffer} == {LENGTH}
    off_policy = contrib.TQC("MlpPolicy", walkers(), learning_starts=60, train_freq=8, device="cpu")
    off_policy.learn(180)
    assert off_policy.num_timesteps >= 180
    stored = off_policy.replay_buffer.observations[:60]
    # What the buffer holds is not normalised.
    assert ProsthesisVectorEnv(1, CONFIG).single_observation_space.contains(stored[5, 0])
