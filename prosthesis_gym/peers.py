"""Other simulators on the same machine, for comparison: env steps of 5 ms per second on two legs or one and a trunk."""

import numpy as np
from numpy.typing import NDArray

from prosthesis_gym.config import CONTROL_PERIOD_S, resolve
from prosthesis_gym.extras import optional
from prosthesis_gym.rates import median_rates

PHYSICS_STEP_S = 5e-4
"""Physics step of MuJoCo's rollout, unless another is asked for."""
STEADY_ERROR = 0.0007
"""Largest error of the default solver's steady kinematics, damper knee (`prosthesis-gym accuracy`)."""
_FINEST_STEP_S = 1e-5
_STEPS_S = (5e-3, 2.5e-3, 1.25e-3, 1e-3, 5e-4, 2.5e-4, 1e-4)


def walker_mjcf() -> str:
    """Return the walker's planar mechanism as MJCF: Table 1, ankle, knee, heel and ball on a floor."""
    config = resolve({})
    body, ankle, knee = config["body"], config["ankle"], config["knee"]

    def inertial(part: str) -> str:
        inertia = body[f"{part}_inertia_kg_m2"]
        place = f"{body.get(f'{part}_com_x_m', 0.0)} 0 {body[f'{part}_com_y_m']}"
        mass = body[f"{part}_mass_kg"]
        return f'<inertial pos="{place}" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>'

    hinge = 'type="hinge" axis="0 -1 0"'
    friction = f'damping="{knee["viscous_nms_rad"]}" frictionloss="{knee["dry_friction_nm"]}"'
    spring = f'stiffness="{ankle["stiffness_nm_rad"]}" damping="{ankle["damping_nms_rad"]}"'
    points = "".join(
        f'<geom type="sphere" size="0.01" pos="{body[f"{end}_x_m"]} 0 {-body["foot_height_m"]}"/>'
        for end in ("heel", "ball")
    )
    return f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{PHYSICS_STEP_S}" integrator="implicitfast"/>
  <worldbody>
    <geom type="plane" size="0 0 1" friction="{config["ground"]["friction"]}"/>
    <body name="trunk" pos="0 0 0.92">
      <joint type="slide" axis="1 0 0"/> <joint type="slide" axis="0 0 1"/>
      <joint {hinge} stiffness="5000" damping="500"/>
      {inertial("trunk")}
      <body name="thigh">
        <joint name="hip" {hinge} damping="100"/> {inertial("thigh")}
        <body name="calf" pos="0 0 {-body["thigh_length_m"]}">
          <joint name="knee" {hinge} {friction} range="-2 -0.05" limited="true"/> {inertial("calf")}
          <body name="foot" pos="0 0 {-(body["calf_length_m"] + body["tube_length_m"])}">
            <joint name="ankle" {hinge} {spring}/> {inertial("foot")} {points}
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="hip"/><motor joint="knee"/></actuator>
</mujoco>"""


def mujoco_error(step_s: float) -> float:
    """Error of MuJoCo's implicitfast steps: of the peaks of hip height, hip, knee and ankle angle over 0.4 s.

    The mechanism lands from its upright posture and is driven by sinusoidal torques of hip and knee. Errors are against
    steps of 10 µs, over each quantity's range.
    """
    fine, coarse = _driven_peaks(_FINEST_STEP_S), _driven_peaks(step_s)
    return float((np.abs(coarse - fine).max(axis=0) / np.ptp(fine, axis=0)).max())


def _driven_peaks(step_s: float) -> NDArray[np.float64]:
    """Return the highest and lowest values of hip height and joint angles, (2, 4)."""
    mujoco = optional("mujoco", "dev")
    model = mujoco.MjModel.from_xml_string(walker_mjcf())
    model.opt.timestep = step_s
    data = mujoco.MjData(model)
    per_sample = round(CONTROL_PERIOD_S / step_s)
    samples = []
    for index in range(80 * per_sample):
        turns = 2.0 * np.pi * index * step_s
        data.ctrl[:] = 8.0 + 15.0 * np.sin(2.0 * turns), 5.0 * np.sin(3.0 * turns)
        mujoco.mj_step(model, data)
        if (index + 1) % per_sample == 0:
            samples.append(data.qpos[[1, 3, 4, 5]].copy())
    return np.array([np.max(samples, axis=0), np.min(samples, axis=0)])


def mujoco_step_of(error: float) -> float:
    """Return MuJoCo's longest step, s, of a few whose error is at most `error`."""
    return next((step_s for step_s in _STEPS_S if mujoco_error(step_s) <= error), _STEPS_S[-1])


def mujoco_rollout(seconds: float, threads: int, step_s: float = PHYSICS_STEP_S) -> float:
    """Env steps per second of MuJoCo's native rollout of the same mechanism, in implicitfast steps of `step_s`."""
    mujoco = optional("mujoco", "dev")
    rollout = optional("mujoco.rollout", "dev")
    model = mujoco.MjModel.from_xml_string(walker_mjcf())
    model.opt.timestep = step_s
    walkers, env_steps = 64 * threads, 20
    substeps = round(CONTROL_PERIOD_S / step_s)
    datas = [mujoco.MjData(model) for _ in range(threads)]
    states = np.empty((walkers, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    mujoco.mj_getState(model, datas[0], states[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states[:] = states[0]
    control = np.random.default_rng(0).uniform(-20.0, 20.0, (walkers, env_steps * substeps, model.nu))
    with rollout.Rollout(nthread=threads) as pool:

        def step() -> int:
            pool.rollout(model, datas, states, control)
            return walkers * env_steps

        return median_rates([step], seconds)[0]


def gymnasium_walker2d(seconds: float) -> float:
    """Env steps per second of Gymnasium's Walker2d-v5, one environment (its step is 8 ms)."""
    gymnasium = optional("gymnasium", "dev")
    for needed in ("mujoco", "imageio"):
        optional(needed, "dev")
    env = gymnasium.make("Walker2d-v5")
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(64)]

    def step() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return len(actions)

    return median_rates([step], seconds)[0]


def envpool_walker2d(seconds: float, threads: int) -> float:
    """Env steps per second of EnvPool's Walker2d-v4, 64 environments a thread."""
    envpool = optional("envpool", None)
    env = envpool.make("Walker2d-v4", env_type="gymnasium", num_envs=64 * threads, num_threads=threads)
    env.reset()
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (64 * threads, 6))

    def step() -> int:
        env.step(actions)
        return len(actions)

    return median_rates([step], seconds)[0]
