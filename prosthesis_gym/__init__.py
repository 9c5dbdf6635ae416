"""Train and stress-test knee-prosthesis controllers in closed loop with a simulated walking human.

Importing the package registers its environments with Gymnasium:

>>> import gymnasium, prosthesis_gym
>>> env = gymnasium.make("prosthesis_gym/DamperKnee-v0")
>>> envs = gymnasium.make_vec("prosthesis_gym/DamperKnee-v0", num_envs=1024, scenario="pushes")
"""

from importlib.metadata import version

from gymnasium.envs.registration import register

from prosthesis_gym._core import InternalError
from prosthesis_gym.devices import DEVICES
from prosthesis_gym.env import ProsthesisEnv
from prosthesis_gym.reasons import TerminationReason
from prosthesis_gym.reward_terms import RewardTerm
from prosthesis_gym.rewards import REWARDS
from prosthesis_gym.scenarios import SCENARIOS
from prosthesis_gym.vector_env import ProsthesisVectorEnv

__version__ = version("prosthesis-gym")
__all__ = [
    "REWARDS",
    "SCENARIOS",
    "InternalError",
    "ProsthesisEnv",
    "ProsthesisVectorEnv",
    "RewardTerm",
    "TerminationReason",
]

for _kind, _device in DEVICES.items():
    register(
        id=_device.env_id,
        entry_point="prosthesis_gym.env:ProsthesisEnv",
        vector_entry_point="prosthesis_gym.vector_env:ProsthesisVectorEnv",
        kwargs={"device": _kind},
    )
