"""Pictures of walkers: for Gymnasium's `render`, for video clips and for figures. Needs the extra `render`.

>>> from prosthesis_gym.rendering import save_clip
>>> save_clip(run_trial({"action": {"mode": "state_machine"}}), "walk.mp4", slow_motion=2)
"""

from prosthesis_gym.rendering.clip import save_clip, save_picture
from prosthesis_gym.rendering.renderer import WalkerRenderer

__all__ = ["WalkerRenderer", "save_clip", "save_picture"]
