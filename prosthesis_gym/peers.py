"""Other simulators on the same machine, for comparison: env steps of 5 ms per second on two legs or one and a trunk."""

import time
from collections.abc import Callable

import numpy as np

from prosthesis_gym.config import CONTROL_PERIOD_S, resolve
from prosthesis_gym.extras import optional

_PHYSICS_STEP_S = 5e-4


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
  <option timestep="{_PHYSICS_STEP_S}" integrator="implicitfast"/>
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


def mujoco_rollout(seconds: float, threads: int) -> float:
    """Env steps per second of MuJoCo's native rollout of the same mechanism: 10 implicitfast steps of 0.5 ms each."""
    mujoco = optional("mujoco", "dev")
    rollout = optional("mujoco.rollout", "dev")
    model = mujoco.MjModel.from_xml_string(walker_mjcf())
    walkers, env_steps = 64 * threads, 20
    substeps = round(CONTROL_PERIOD_S / _PHYSICS_STEP_S)
    datas = [mujoco.MjData(model) for _ in range(threads)]
    states = np.empty((walkers, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    mujoco.mj_getState(model, datas[0], states[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states[:] = states[0]
    control = np.random.default_rng(0).uniform(-20.0, 20.0, (walkers, env_steps * substeps, model.nu))
    with rollout.Rollout(nthread=threads) as pool:

        def step() -> int:
            pool.rollout(model, datas, states, control)
            return walkers * env_steps

        return _rate(step, seconds)


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

    return _rate(step, seconds)


def envpool_walker2d(seconds: float, threads: int) -> float:
    """Env steps per second of EnvPool's Walker2d-v4, 64 environments a thread."""
    envpool = optional("envpool", "dev")
    env = envpool.make("Walker2d-v4", env_type="gymnasium", num_envs=64 * threads, num_threads=threads)
    env.reset()
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (64 * threads, 6))

    def step() -> int:
        env.step(actions)
        return len(actions)

    return _rate(step, seconds)


def _rate(step: Callable[[], int], seconds: float) -> float:
    for _ in range(2):
        step()
    steps, began = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - began) < seconds:
        steps += step()
    return steps / elapsed
